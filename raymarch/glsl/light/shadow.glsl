// Hard shadow: 0 if an occluder lies between a surface point and the light, else 1.
// The ray counts as blocked at a distance to a surface above 0 but below that at which it starts, so that it does not
// hit the surface that it starts from. If half of the field's value at the start is less, that is the threshold,
// because a bound may be flat there. The threshold grows along the ray with the coordinates and their ulp.
// No ray is traced for a surface that faces away from the light or is out of its range.
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = spawn_ray(surface.p, geometric_normal(surface), light.direction, surface.t, start);
#ifdef ANALYTIC
    bool inside = u_side < 0.0;
    if (!inside && solved_hit(ray.origin, ray.direction, start) < light.distance) return 0.0;
    vec2 range = vec2(start, light.distance);
    range = inside ? scene_box(ray, range) : marched_range(ray, range);
#else
    vec2 range = scene_box(ray, vec2(start, light.distance));
#endif
    float near = 0.5 * contact(surface.p, surface.t);
    float s = range.x;
    float z = 0.0;
    float before = 0.0;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) return 1.0;
        last = r;
#ifdef ANALYTIC
        r = u_side * ray_field(ray.origin + s * ray.direction, inside);
#else
        r = u_side * field(ray.origin + s * ray.direction);
#endif
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= near + GROWTH * s) return 0.0;
        before = z;
        z = safe_step(r, s);
        s += z;
    }
    float derivative = (r - last) / before;
    return meets_ahead(r, derivative, range.y - s + z) ? 0.0 : 1.0;
}
