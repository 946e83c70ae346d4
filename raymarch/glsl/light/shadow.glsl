// Hard shadow: 0 if anything stands between a surface point and the light, else 1.
// The ray counts as blocked well before a surface, but nearer to it than where it starts, so that it does not meet the one
// that it comes from; or at half of the field's value where it starts, if that is less, because a bound may be flat there.
// The coordinates grow along the ray, and with them what float32 can tell apart.
// A surface that faces away from the light, or that it does not reach, needs no ray.
// needs: field Ray Surface Light spawn_ray geometric_normal contact GROWTH safe_step meets_ahead shadow_steps scene_box u_side
// gives: hard_shadow
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = spawn_ray(surface.p, geometric_normal(surface), light.direction, surface.t, start);
    vec2 range = scene_box(ray, vec2(start, light.distance));
    float near = 0.5 * contact(surface.p, surface.t);
    float s = range.x;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) return 1.0;
        last = r;
        r = u_side * field(ray.origin + s * ray.direction);
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= near + GROWTH * s) return 0.0;
        s += safe_step(r);
    }
    float derivative = (r - last) / safe_step(last);
    return meets_ahead(r, derivative, range.y - s + safe_step(r)) ? 0.0 : 1.0;
}
