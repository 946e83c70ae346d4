// The start and end of the march of a pixel's ray. It starts where the cones that contain it ended, and is charged
// their cost. False if the ray misses the scene.
uniform float u_spent;  // 1, or 0 if the cones are reused from an earlier frame

bool begins(Ray ray, out March at, out float far, out vec2 spent) {
    vec2 range = range_of(ray);
    at = start_march(ray, range.x);
    far = range.y;
    spent = vec2(0.0);
    bool open = range.x <= range.y && carry_on(at, spent) && at.t <= range.y;
    spent *= u_spent;
#ifdef OWN_START
    if (open) {
        enter(ray, at);
        spent.y += 1.0;
    }
#endif
    return open;
}
