// Where the march of a ray starts, and its range. False if the ray misses the scene.
#ifdef CONES
// It starts where the cones that contain it ended, and is charged their cost.
uniform float u_spent;  // 1, or 0 if the cones are reused from an earlier frame

#endif
bool begins(Ray ray, inout Hit hit, out March at, out vec2 range) {
    range = range_of(ray);
    at = start_march(ray, range.x);
#ifdef CONES
    vec2 spent = vec2(0.0);
#ifdef ANALYTIC
    March carried = at;
    bool met = carry_on(carried, spent) || u_side < 0.0;
    // A cone may begin outside of the solid in which a ray begins. It was then not marched to the end of that solid.
    if (u_side > 0.0) at = carried;
#else
    bool met = range.x <= range.y && carry_on(at, spent);
#endif
    if (!met || at.t > range.y) range.x = 1.0e30;
    hit.iterations += spent.x * u_spent;
    hit.evaluations += spent.y * u_spent;
#endif
#ifdef OWN_START
    bool asked = range.x <= range.y;
    if (asked) enter(ray, at);
#ifdef ANALYTIC
#ifndef CONES
    asked = true;  // by `range_of`
#endif
#endif
    hit.evaluations += float(asked);
#endif
#ifdef STRETCH
    begin_stretch(range.y - at.t);
#endif
    return range.x <= range.y;
}
