// The hit of a pixel's ray, marched in one pass.
Hit trace(Ray ray) {
    vec2 range = range_of(ray);
#ifdef ANALYTIC
    Hit hit = no_hit(0.0);
    if (range.x <= range.y) {
        March at = start_march(ray, range.x);
        hit = no_hit(at.t);
        march(ray, at, hit, range.y);
    }
#ifdef OWN_START
#ifndef UNCOUNTED
    hit.evaluations += 1.0;
#endif
#endif
    keep_solved(hit);
    return hit;
#else
    if (range.x > range.y) return no_hit(0.0);
    March at = start_march(ray, range.x);
#ifdef OWN_START
    enter(ray, at);
#endif
    Hit hit = no_hit(at.t);
    march(ray, at, hit, range.y);
#ifdef OWN_START
#ifndef UNCOUNTED
    hit.evaluations += 1.0;
#endif
#endif
    return hit;
#endif
}
