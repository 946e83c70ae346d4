// The start and end of the march of a pixel's ray. It starts where the cones that contain it ended, and is charged
// their cost. False if the ray misses the scene.
uniform float u_spent;  // 1, or 0 if the cones are reused from an earlier frame

bool begins(Ray ray, out March at, out float far, out vec2 spent) {
    vec2 range = range_of(ray);
    at = start_march(ray, range.x);
    far = range.y;
    spent = vec2(0.0);
#ifdef ANALYTIC
    March carried = at;
    bool met = carry_on(carried, spent);
    // A cone may begin outside of the solid in which a ray begins. It was then not marched to the end of that solid.
    if (u_side > 0.0) at = carried;
    bool open = range.x <= range.y && (met || u_side < 0.0) && at.t <= range.y;
#else
    bool open = range.x <= range.y && carry_on(at, spent) && at.t <= range.y;
#endif
    spent *= u_spent;
#ifdef OWN_START
    if (open) {
        enter(ray, at);
        spent.y += 1.0;
    }
#endif
#ifdef STRETCH
    begin_stretch(far - at.t);
#endif
    return open;
}
