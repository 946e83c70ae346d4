// The hit of a pixel's ray, marched from where the cones that contain it ended.
Hit trace(Ray ray) {
    March at;
    float far;
    vec2 spent;
    Hit hit = no_hit(0.0);
    if (begins(ray, at, far, spent)) march(ray, at, hit, far);
    hit.iterations += spent.x;
    hit.evaluations += spent.y;
#ifdef ANALYTIC
    keep_solved(hit);
#endif
    return hit;
}
