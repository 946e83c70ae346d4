// Rays are marched only inside the scene's box, because nothing lies outside.
uniform float u_far;

#ifdef ANALYTIC
vec2 scene_range(Ray ray) {
#else
vec2 range_of(Ray ray) {
#endif
#ifdef CLIP_PLANES
    return scene_box(ray, between_planes(ray, u_far));
#else
    return scene_box(ray, vec2(0.0, u_far));
#endif
}
