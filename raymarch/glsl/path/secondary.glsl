// The hit of a secondary ray, by the steps of the tracer; inside the solid if `side` is -1. `travelled`,
// the length of the path before it, sets the precision. A step may end on a wall that is a face of the scene's box.
// The first sample lies at `start`; where it does not prove the way from the offset on empty, the ray goes back. Where
// another surface lies before it, as in a corner, the ray starts nearer, by an eighth each time.
Hit trace_secondary(Ray ray, float start, float travelled, float side) {
    Hit hit = no_hit(0.0);
    float offset = min(spawn_offset(ray.origin, travelled), start);
    vec2 range = scene_box(ray, vec2(offset, 2.0 * u_far));
    bool inside = side * u_side < 0.0;
#ifdef ANALYTIC
    float solved = inside ? 1.0e30 : solved_ahead(ray, travelled);
    if (solved <= range.y) hit.t = solved;
    if (!inside) {
        range = marched_range(ray, range);
        range.y = min(range.y, solved);
    }
#endif
    float begin = inside ? min(range.x, range.y) : range.x;  // thin glass and corners may end before `start`
    March at = March(begin, 0.0, 0.0, 0.0, -0.7, 0.0, false, false);
    float skipped = max(min(start, range.y) - begin, 0.0);
    float slope = 0.0;
    float share = contact_share * epsilon_pixels;
#ifdef STRETCH
    begin_stretch(range.y - begin);
#endif
#ifdef CUTS
#ifdef ADVANCE
    approach = 1.0;
#endif
#endif
    float end = 0.0;  // 1: the ray has left its range, 2: it has met a solid
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
        if (i == 0) z += skipped;
        if (at.t + min(z, at.r) > range.y) {
            end = 1.0;
            break;
        }
        float t = at.t + z;
        vec3 p = ray.origin + t * ray.direction;
#ifdef ADVANCE
#ifdef CUTS
        float rate = approach;
#endif
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
        hit.evaluations += 1.0;
#ifdef CUTS
#ifdef ADVANCE
        noise = noise_of(ray, t);
        bool entered = doubtful && enters_ahead(at, t, noise);
#else
        bool entered = doubtful && enters(at, t, r, noise);
#endif
        if (doubtful && !entered) continue;
#endif
        bool near = r < nearness(p, travelled + t, share);
        if (near && at.t == begin && at.r == 0.0 && begin > 0.001 * offset) {
            share *= 0.125;
            begin *= 0.125;
            at.t = begin;
            continue;
        }
        float proven = i == 0 ? z - skipped + 0.25 * offset : at.r;
#ifdef CUTS
        if (first && i > 0) proven = z;
#ifdef ADVANCE
        bool empty = entered || z <= proven + way_behind;
#else
        bool empty = entered || z <= proven + abs(r);
#endif
        bool known = z > 0.0 && !first && i > 0;
        slope = entered ? at.last_derivative : known ? (r - at.r) / z : 0.0;
#ifdef ADVANCE
        bool unproven = empty && near && value_there >= -noise;
#else
        bool unproven = empty && near && r >= -noise;
#endif
#ifdef STANDS
        unproven = unproven && !inside;  // the face of what glass stands on is a surface
#endif
        if (unproven && (first || r < at.r)) {
#ifdef ADVANCE
            doubt_ahead(at, t, known ? slope : -1.0, rate, noise);
#else
            doubt(at, t, r, known ? slope : -1.0);
#endif
            continue;
        }
#else
#ifdef ADVANCE
        bool empty = z <= proven + way_behind;
#else
        bool empty = z <= proven + abs(r);
#endif
        bool known = z > 0.0 && i > 0;
        slope = known ? (r - at.r) / z : 0.0;
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
            end = 2.0;
            float rest = slope < 0.0 ? r / max(-slope, 0.125) : r;
            hit.t = max(t + rest, begin);  // a ray may start deep in a solid that was hidden before
            hit.residual = max(r, 0.0);  // an upper bound
            break;
        }
        move(at, empty, t, r, known ? slope : at.derivative);
    }
    bool meets = end == 0.0 && meets_ahead(at.r, slope, range.y - at.t);
    if (meets) hit.t = at.t + at.r / -slope;
    hit.found = meets || end == 2.0;
#ifdef ANALYTIC
    hit.found = hit.found || hit.t > 0.0;
#endif
#ifdef FILMS
    // A ray between solids that touch starts on the face of both: the one that it meets is that which holds the offset.
    // In glass it is the glass.
    if (hit.found && (inside || hit.t < offset)) {
        float place = inside ? max(hit.t - offset, 0.5 * hit.t) : offset;
        float depth = u_side * field(ray.origin + place * ray.direction);
        hit.evaluations += 1.0;
        if (depth < 0.0) {
            hit.t = place;
            hit.residual = depth;
        }
    }
#endif
    return hit;
}
