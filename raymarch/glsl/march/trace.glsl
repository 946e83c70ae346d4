// The hit of a pixel's ray, marched in one pass.
Hit trace(Ray ray) {
    vec2 range = range_of(ray);
    Hit hit = no_hit(0.0);
#ifdef ANALYTIC
    if (range.x <= range.y) {
        March at = start_march(ray, range.x);
#ifdef STRETCH
        begin_stretch(range.y - at.t);
#endif
        march(ray, at, hit, range.y);
    }
    keep_solved(hit);
#else
    if (range.x > range.y) return hit;
    March at = start_march(ray, range.x);
#ifdef OWN_START
    enter(ray, at);
#endif
#ifdef STRETCH
    begin_stretch(range.y - at.t);
#endif
    march(ray, at, hit, range.y);
#endif
#ifdef OWN_START
#ifndef UNCOUNTED
    hit.evaluations += 1.0;
#endif
#endif
    return hit;
}
