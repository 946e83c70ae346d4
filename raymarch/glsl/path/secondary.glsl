// The hit of a secondary ray, by plain steps from `start`; inside the solid if `side` is -1. `travelled` is the length
// of the path before it, which sets the precision.
Hit trace_secondary(Ray ray, float start, float travelled, float side) {
    Hit hit = no_hit(0.0);
    vec2 range = scene_box(ray, vec2(start, 2.0 * u_far));
#ifdef ANALYTIC
    bool inside = side * u_side < 0.0;
    float solved = inside ? 1.0e30 : solved_hit(ray.origin, ray.direction, start);
    bool blocked = solved <= range.y;
    if (blocked) hit = Hit(true, true, solved, 0.0, 0.0, 0.0, 0.0);
    if (!inside) {
        range = marched_range(ray, range);
        range.y = min(range.y, solved);
    }
#endif
#ifdef ANALYTIC
    float t = inside ? min(range.x, range.y) : range.x;  // thin glass may end before `start`
#else
    float t = side < 0.0 ? min(range.x, range.y) : range.x;  // thin glass may end before `start`
#endif
    float z = 0.0;
    float before = 0.0;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < secondary_steps; i++) {
        if (t > range.y) return hit;
        vec3 p = ray.origin + t * ray.direction;
        last = r;
#ifdef ANALYTIC
        r = side * u_side * ray_field(p, inside);
#else
        r = side * u_side * field(p);
#endif
        hit.evaluations += 1.0;
        if (r < contact(p, travelled + t)) {
            hit.found = true;
            hit.t = t + r;
            hit.residual = max(r, 0.0);  // an upper bound
            return hit;
        }
        before = z;
        z = safe_step(r, t);
        t += z;
    }
    t -= z;
    float derivative = (r - last) / before;
#ifdef ANALYTIC
    bool meets = meets_ahead(r, derivative, range.y - t);
    if (meets) hit.t = t + r / -derivative;
    hit.found = meets || blocked;
#else
    hit.found = meets_ahead(r, derivative, range.y - t);
    if (hit.found) hit.t = t + r / -derivative;
#endif
    return hit;
}
