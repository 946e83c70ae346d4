// Hard shadow: 0 if anything stands between a surface point and the light, else 1.
// The ray counts as blocked well before a surface, but nearer to it than where it starts, so that it does not meet the one
// that it comes from; or at half of the field's value where it starts, if that is less, because a bound may be flat there.
// A surface that faces away from the light, or that it does not reach, needs no ray.
// needs: field Ray Surface Light leaving unbent contact shadow_steps scene_box u_side
// gives: hard_shadow
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = leaving(surface.p, unbent(surface), light.direction, surface.t, start);
    vec2 range = scene_box(ray, vec2(start, light.distance));
    float near = 0.5 * contact(surface.p, surface.t);
    float s = range.x;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) return 1.0;
        float r = u_side * field(ray.origin + s * ray.direction);
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= near) return 0.0;
        s += r;
    }
    return 1.0;
}
