// Hard shadow: 0 if anything stands between a surface point and the light, else 1.
// The ray starts two epsilons off the surface and counts as blocked half an epsilon before a surface, so that
// it does not meet the surface that it comes from; or at half of the field's value where it starts, if that is less,
// because a bound may be flat there. A surface that faces away from the light, or that it does not reach, needs no ray.
// needs: field Ray Surface Light epsilon shadow_steps scene_box u_side
// gives: hard_shadow
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float offset = 2.0 * epsilon(surface.p, surface.t);
    Ray ray = Ray(surface.p + offset * surface.normal, light.direction);
    vec2 range = scene_box(ray, vec2(0.0, light.distance));
    float near = 0.25 * offset;
    float s = range.x;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) return 1.0;
        float r = u_side * field(ray.origin + s * ray.direction);
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= max(near, 0.0)) return 0.0;
        s += r;
    }
    return 1.0;
}
