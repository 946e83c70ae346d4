// The hit of a secondary ray, by the steps of the tracer from `start`; inside the solid if `side` is -1. `travelled`,
// the length of the path before it, sets the precision. A step may end on a wall that is a face of the scene's box.
// Where another surface lies before `start`, as in a corner, the ray starts nearer, by an eighth each time.
Hit trace_secondary(Ray ray, float start, float travelled, float side) {
    Hit hit = no_hit(0.0);
    vec2 range = scene_box(ray, vec2(start, 2.0 * u_far));
    bool inside = side * u_side < 0.0;
#ifdef ANALYTIC
    float solved = inside ? 1.0e30 : solved_hit(ray.origin, ray.direction, left_behind(ray.origin, travelled));
    bool blocked = solved <= range.y;
    if (blocked) hit.t = solved;
    hit.found = blocked;
    if (!inside) {
        range = marched_range(ray, range);
        range.y = min(range.y, solved);
    }
#endif
    float begin = inside ? min(range.x, range.y) : range.x;  // thin glass and corners may end before `start`
    March at = March(begin, 0.0, 0.0, 0.0, -0.7, 0.0, false, false);
    float slope = 0.0;
    float share = contact_share * epsilon_pixels;
#ifdef STRETCH
    begin_stretch(range.y - begin);
#endif
    for (int i = 0; i < secondary_steps; i++) {
#ifdef CUTS
        float noise = noise_of(ray, at.t);
        bool doubtful = in_doubt(at);
        bool first = !doubtful && at.r <= noise;
        float depth = contact(ray.origin + at.t * ray.direction, travelled + at.t);
        float z = doubtful ? doubt_step(at, depth, 1.0e30) : first ? depth : step_length(at, range.y);
#else
        float z = step_length(at, range.y);
#endif
        if (at.t + min(z, at.r) > range.y) return hit;
        float t = at.t + z;
        vec3 p = ray.origin + t * ray.direction;
#ifdef ADVANCE
#ifdef ANALYTIC
        float r = way_ahead(ray, t, side * u_side, inside);
#else
        float r = way_ahead(ray, t, side * u_side);
#endif
#else
#ifdef ANALYTIC
        float r = side * u_side * ray_field(p, inside);
#else
        float r = side * u_side * field(p);
#endif
#endif
#ifndef UNCOUNTED
        hit.evaluations += 1.0;
#endif
#ifdef CUTS
        bool entered = doubtful && enters(at, t, r, noise);
        if (doubtful && !entered) continue;
#endif
        bool near = r < nearness(p, travelled + t, share);
        if (near && at.t == begin && at.r == 0.0 && begin > 0.001 * start) {
            share *= 0.125;
            begin *= 0.125;
            at.t = begin;
            continue;
        }
#ifdef CUTS
#ifdef ADVANCE
        bool empty = entered || first || z <= at.r + way_behind;
#else
        bool empty = entered || first || z <= at.r + abs(r);
#endif
        bool known = z > 0.0 && !first;
        slope = entered ? at.last_derivative : known ? (r - at.r) / z : 0.0;
        bool unproven = empty && near && r >= -noise;
        if (unproven && (first || r < at.r)) {
            doubt(at, t, r, known ? slope : -1.0);
            continue;
        }
#else
#ifdef ADVANCE
        bool empty = z <= at.r + way_behind;
#else
        bool empty = z <= at.r + abs(r);
#endif
        slope = z > 0.0 ? (r - at.r) / z : 0.0;
#endif
#ifdef ANALYTIC
        bool met = empty && near && t + r <= solved;
#else
        bool met = empty && near;
#endif
#ifdef CUTS
        met = met && !unproven;
#endif
        if (met) {
            hit.found = true;
            float rest = slope < 0.0 ? r / max(-slope, 0.125) : r;
            hit.t = max(t + rest, begin);  // a ray may start deep in a solid that was hidden before
            hit.residual = max(r, 0.0);  // an upper bound
            return hit;
        }
#ifdef CUTS
        move(at, empty, t, r, known ? slope : at.derivative);
#else
        move(at, empty, t, r, z > 0.0 ? slope : at.derivative);
#endif
    }
    bool meets = meets_ahead(at.r, slope, range.y - at.t);
    if (meets) hit.t = at.t + at.r / -slope;
#ifdef ANALYTIC
    hit.found = meets || blocked;
#else
    hit.found = meets;
#endif
    return hit;
}
