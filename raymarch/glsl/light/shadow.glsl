// Hard shadow: 0 if an occluder lies between a surface point and the light, else 1. A sample nearer to a surface than
// `near` is a hit. `near` is below the distance at which the ray starts, and at most half of the first sample, because
// a bound may be flat there. It grows along the ray with the ulp of the coordinates.
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
    float rise = clamp(dot(geometric_normal(surface), light.direction), -1.0, 0.999);
    March at = March(range.x, 0.0, 0.0, 0.0, rise, 0.0, false, false);
    float slope = 0.0;
    for (int i = 0; i < shadow_steps; i++) {
        float z = step_length(at, range.y);
        if (at.t + min(z, at.r) >= range.y) return 1.0;
        float t = at.t + z;
#ifdef ANALYTIC
        float r = u_side * ray_field(ray.origin + t * ray.direction, inside);
#else
        float r = u_side * field(ray.origin + t * ray.direction);
#endif
        if (i == 0) near = min(near, 0.5 * r);
        if (r <= near + GROWTH * t && t < light.distance) return 0.0;
        slope = z > 0.0 ? (r - at.r) / z : 0.0;
        move(at, z <= at.r + abs(r), t, r, z > 0.0 ? slope : at.derivative);
    }
    return meets_ahead(at.r, slope, range.y - at.t) ? 0.0 : 1.0;
}
