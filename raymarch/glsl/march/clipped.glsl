// Rays are marched only inside the scene's box: nothing lies outside.
uniform float u_far;

#ifdef ANALYTIC
vec2 scene_range(Ray ray) {
#else
vec2 range_of(Ray ray) {
#endif
#ifdef CLIP_PLANES
    vec2 range = between_planes(ray, u_far);
#ifdef EDGES
    range.y += 4.0 * pixel_at(range.y);
#endif
    return scene_box(ray, range);
#else
#ifdef EDGES
    return scene_box(ray, vec2(0.0, u_far + 4.0 * pixel_at(u_far)));
#else
    return scene_box(ray, vec2(0.0, u_far));
#endif
#endif
}
