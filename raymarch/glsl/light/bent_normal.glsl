// The normal with relief, which faces the camera; without one, that of the surface as in scenes without any relief.
vec3 bent_normal(vec3 n, vec3 direction, vec3 bump_gradient) {
    if (bump_gradient == vec3(0.0)) {
        return u_side * visible_side(u_side * n, direction);
    }
    return shading_normal(n, -direction, bump_gradient);
}
