// Hard shadow: 0 if an occluder lies between a surface point and the light, else 1. A sample nearer to a surface than
// `near` is a hit. `near` is below the distance at which the ray starts, and at most half of the first sample, because
// a bound may be flat there. It grows along the ray with the ulp of the coordinates, and is at most 1/64 of the rest of
// the ray, so that what touches the light at a cosine above that casts no shadow on it.
// The first sample proves the ray empty from half an epsilon behind the offset on. If it does not, as beside what
// stands on the surface, the ray goes back to the offset.
float hard_shadow(Surface surface, Light light) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    float start;
    Ray ray = shadow_ray(surface, light, range, start);
    float end = range.y;
    float offset = range.x;
#ifdef ANALYTIC
    bool inside = u_side < 0.0;
    if (!inside && solved_ahead(ray, surface.t) < end) return 0.0;
    range = inside ? scene_box(ray, range) : marched_range(ray, range);
#else
    range = scene_box(ray, range);
#endif
    float skipped = max(start - range.x, 0.0);
    float near = 0.5 * contact(surface.p, surface.t);
    float rise = clamp(dot(geometric_normal(surface), light.direction), -1.0, 0.999);
    March at = March(range.x, 0.0, 0.0, 0.0, rise, 0.0, false, false);
    bool meets = false;
#ifdef STRETCH
    begin_stretch(range.y - range.x);
#endif
#ifdef CUTS
#ifdef ADVANCE
    approach = 1.0;
#endif
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
        if (i == 0) z += skipped;
        if (at.t + min(z, at.r) >= range.y) return 1.0;
        float t = at.t + z;
#ifdef ADVANCE
#ifdef CUTS
        noise = noise_of(ray, t);
        float rate = approach;
#endif
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
#ifdef ADVANCE
            if (enters_ahead(at, t, noise)) return t < end ? 0.0 : 1.0;
#else
            if (enters(at, t, r, noise)) return t < end ? 0.0 : 1.0;
#endif
            continue;
        }
#endif
        if (i == 0) near = min(near, 0.5 * r);
        float proven = i == 0 ? z - skipped + 0.25 * offset : at.r;
#ifdef CUTS
        if (first && i > 0) proven = z;
#ifdef ADVANCE
        if (value_there < -noise && t < end) return 0.0;
        bool empty = z <= proven + way_behind;
#else
        if (r < -noise && t < end) return 0.0;
        bool empty = z <= proven + abs(r);
#endif
        bool known = z > 0.0 && !first && i > 0;
        float slope = known ? (r - at.r) / z : 0.0;
        if (r <= near + GROWTH * t && empty && slope <= 0.0) {
#ifdef ADVANCE
            doubt_ahead(at, t, known ? slope : -1.0, rate, noise);
#else
            doubt(at, t, r, known ? slope : -1.0);
#endif
            continue;
        }
        move(at, empty, t, r, known ? slope : at.derivative);
#else
        if (r <= min(near + GROWTH * t, 0.015625 * (end - t)) && t < end) return 0.0;
        bool known = z > 0.0 && i > 0;
        float slope = known ? (r - at.r) / z : 0.0;
#ifdef ADVANCE
        move(at, z <= proven + way_behind, t, r, known ? slope : at.derivative);
#else
        move(at, z <= proven + abs(r), t, r, known ? slope : at.derivative);
#endif
#endif
        meets = meets_ahead(at.r, slope, range.y - at.t);
    }
    return meets ? 0.0 : 1.0;
}
