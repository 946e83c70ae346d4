// The hit of a secondary ray, by the steps of the tracer from `start`; inside the solid if `side` is -1. `travelled`,
// the length of the path before it, sets the precision. A step may end on a wall that is a face of the scene's box.
Hit trace_secondary(Ray ray, float start, float travelled, float side) {
    Hit hit = no_hit(0.0);
    vec2 range = scene_box(ray, vec2(start, 2.0 * u_far));
    bool inside = side * u_side < 0.0;
#ifdef ANALYTIC
    float solved = inside ? 1.0e30 : solved_hit(ray.origin, ray.direction, start);
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
    for (int i = 0; i < secondary_steps; i++) {
        float z = step_length(at, range.y);
        if (at.t + min(z, at.r) > range.y) return hit;
        float t = at.t + z;
        vec3 p = ray.origin + t * ray.direction;
#ifdef ANALYTIC
        float r = side * u_side * ray_field(p, inside);
#else
        float r = side * u_side * field(p);
#endif
#ifndef UNCOUNTED
        hit.evaluations += 1.0;
#endif
        bool empty = z <= at.r + abs(r);
#ifdef ANALYTIC
        bool met = empty && r < contact(p, travelled + t) && t + r <= solved;
#else
        bool met = empty && r < contact(p, travelled + t);
#endif
        if (met) {
            hit.found = true;
            hit.t = max(t + r, begin);  // a ray may start deep in a solid that was hidden before
            hit.residual = max(r, 0.0);  // an upper bound
            return hit;
        }
        slope = z > 0.0 ? (r - at.r) / z : 0.0;
        move(at, empty, t, r, z > 0.0 ? slope : at.derivative);
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
