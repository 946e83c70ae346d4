// The hit of a pixel's ray, marched in one pass.
Hit trace(Ray ray) {
    Hit hit = no_hit(0.0);
    March at;
    vec2 range;
    if (begins(ray, hit, at, range)) march(ray, at, hit, range.y);
#ifdef ANALYTIC
    keep_solved(hit);
#endif
    return hit;
}
