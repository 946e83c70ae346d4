// Rays are marched from the camera to the far end.
uniform float u_far;

#ifdef ANALYTIC
vec2 scene_range(Ray ray) {
#else
vec2 range_of(Ray ray) {
#endif
#ifdef CLIP_PLANES
    return between_planes(ray, u_far);
#else
    return vec2(0.0, u_far);
#endif
}
