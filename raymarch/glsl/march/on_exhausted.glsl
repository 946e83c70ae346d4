// A ray that runs out of steps takes its last sample as hit, if that is within a pixel width of the surface and the ray
// does not rise from it: a ray that has passed an edge would show a surface that it misses.
void on_exhausted(inout Hit hit, float derivative) {
#ifdef ORTHOGRAPHIC
    hit.found = hit.residual < u_pixel && derivative <= 0.0;
#else
    hit.found = hit.residual < u_pixel * hit.t && derivative <= 0.0;
#endif
}
