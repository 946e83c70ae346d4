// A ray that runs out of steps takes the point where it came nearest, if that is within a pixel.
// needs: Hit u_pixel
// gives: on_exhausted
void on_exhausted(inout Hit hit) {
    hit.done = false;
    hit.found = hit.residual < u_pixel * hit.t;
}
