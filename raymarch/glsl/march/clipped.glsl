// Rays are marched only inside the scene's box: nothing lies outside.
uniform float u_far;

#ifdef ANALYTIC
vec2 scene_range(Ray ray) {
#else
vec2 range_of(Ray ray) {
#endif
#ifdef CLIP_PLANES
    vec2 range = between_planes(ray, u_far);
#else
    vec2 range = vec2(0.0, u_far);
#endif
#ifdef EDGES
    range.y += 4.0 * pixel_at(range.y);
#endif
#ifdef BOUNDED
    return scene_box(ray, range);
#else
    return range;
#endif
}
