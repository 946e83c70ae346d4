// Hard shadow: 0 if an occluder lies between a surface point and the light, else 1. A sample nearer to a surface than
// `near` is a hit. `near` is below the distance at which the ray starts, and at most half of the first sample, because
// a bound may be flat there. It grows along the ray with the ulp of the coordinates, and is at most 1/64 of the rest of
// the ray, so that what touches the light at a cosine above that casts no shadow on it.
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    Ray ray = shadow_ray(surface, light, range);
    float end = range.y;
#ifdef ANALYTIC
    bool inside = u_side < 0.0;
    if (!inside && solved_hit(ray.origin, ray.direction, left_behind(ray.origin, surface.t)) < end) return 0.0;
    range = inside ? scene_box(ray, range) : marched_range(ray, range);
#else
    range = scene_box(ray, range);
#endif
    float near = 0.5 * contact(surface.p, surface.t);
    float rise = clamp(dot(geometric_normal(surface), light.direction), -1.0, 0.999);
    March at = March(range.x, 0.0, 0.0, 0.0, rise, 0.0, false, false);
    float slope = 0.0;
#ifdef STRETCH
    begin_stretch(range.y - range.x);
#endif
    for (int i = 0; i < shadow_steps; i++) {
#ifdef CUTS
        float noise = noise_of(ray, at.t);
        bool doubtful = in_doubt(at);
        bool first = !doubtful && at.r <= noise;
        float z = doubtful ? doubt_step(at, near + noise, 1.0e30) : first ? near + noise : step_length(at, range.y);
#else
        float z = step_length(at, range.y);
#endif
        if (at.t + min(z, at.r) >= range.y) return 1.0;
        float t = at.t + z;
#ifdef ADVANCE
#ifdef ANALYTIC
        float r = way_ahead(ray, t, u_side, inside);
#else
        float r = way_ahead(ray, t, u_side);
#endif
#else
#ifdef ANALYTIC
        float r = u_side * ray_field(ray.origin + t * ray.direction, inside);
#else
        float r = u_side * field(ray.origin + t * ray.direction);
#endif
#endif
#ifdef CUTS
        if (doubtful) {
            if (enters(at, t, r, noise)) return t < end ? 0.0 : 1.0;
            continue;
        }
#endif
        if (i == 0) near = min(near, 0.5 * r);
#ifdef CUTS
        if (r < -noise && t < end) return 0.0;
#ifdef ADVANCE
        bool empty = first || z <= at.r + way_behind;
#else
        bool empty = first || z <= at.r + abs(r);
#endif
        bool known = z > 0.0 && !first;
        slope = known ? (r - at.r) / z : 0.0;
        if (r <= near + GROWTH * t && empty && slope <= 0.0) {
            doubt(at, t, r, known ? slope : -1.0);
            continue;
        }
        move(at, empty, t, r, known ? slope : at.derivative);
#else
        if (r <= min(near + GROWTH * t, 0.015625 * (end - t)) && t < end) return 0.0;
        slope = z > 0.0 ? (r - at.r) / z : 0.0;
#ifdef ADVANCE
        move(at, z <= at.r + way_behind, t, r, z > 0.0 ? slope : at.derivative);
#else
        move(at, z <= at.r + abs(r), t, r, z > 0.0 ? slope : at.derivative);
#endif
#endif
    }
    return meets_ahead(at.r, slope, range.y - at.t) ? 0.0 : 1.0;
}
