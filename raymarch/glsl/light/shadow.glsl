// Hard shadow: 0 if anything stands between a surface point and the light, else 1.
// The ray starts two epsilons off the surface and counts as blocked half an epsilon before a surface, so that
// it does not meet the surface that it comes from; or at half of the field's value where it starts, if that is less,
// because a bound may be flat there. A surface that faces away from the light needs no ray.
// needs: field Ray epsilon max_steps scene_box u_side
// gives: shadow_ray
float shadow_ray(vec3 p, vec3 normal, float t, vec3 direction, float far) {
    if (dot(normal, direction) <= 0.0) return 0.0;
    float offset = 2.0 * epsilon(p, t);
    Ray ray = Ray(p + offset * normal, direction);
    vec2 range = scene_box(ray, vec2(0.0, far));
    float near = 0.25 * offset;
    float s = range.x;
    for (int i = 0; i < max_steps; i++) {
        if (s >= range.y) return 1.0;
        float r = u_side * field(ray.origin + s * direction);
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= max(near, 0.0)) return 0.0;
        s += r;
    }
    return 1.0;
}
