// The start and end of the march of a pixel's ray. False if the ray misses the scene.
bool begins(Ray ray, out March at, out float far, out vec2 spent) {
    vec2 range = range_of(ray);
    at = start_march(ray, range.x);
    far = range.y;
    spent = vec2(0.0);
#ifdef OWN_START
    if (range.x <= range.y) {
        enter(ray, at);
        spent.y = 1.0;
    }
#endif
#ifdef STRETCH
    begin_stretch(far - at.t);
#endif
    return range.x <= range.y;
}
