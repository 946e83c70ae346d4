// Rays are marched only inside the scene's box, because nothing lies outside.
uniform float u_far;

#ifdef ANALYTIC
vec2 scene_range(Ray ray) {
#else
vec2 range_of(Ray ray) {
#endif
#ifdef EDGES
#ifdef ORTHOGRAPHIC
    float far = u_far + 4.0 * u_pixel;
#else
    float far = u_far * (1.0 + 4.0 * u_pixel);
#endif
#ifdef CLIP_PLANES
    return scene_box(ray, between_planes(ray, far));
#else
    return scene_box(ray, vec2(0.0, far));
#endif
#else
#ifdef CLIP_PLANES
    return scene_box(ray, between_planes(ray, u_far));
#else
    return scene_box(ray, vec2(0.0, u_far));
#endif
#endif
}
