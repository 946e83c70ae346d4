// A ray that runs out of steps takes its last sample as hit, if that is within a pixel width of the surface.
void on_exhausted(inout Hit hit) {
    hit.done = false;
#ifdef ORTHOGRAPHIC
    hit.found = hit.residual < u_pixel;
#else
    hit.found = hit.residual < u_pixel * hit.t;
#endif
}
