// A ray that runs out of steps takes its last sample as hit, if that is within a pixel width of the surface and the ray
// does not rise from it: a ray that has passed an edge would show a surface that it misses. Where `contact_share` is
// below 1/16, the surface may be farther away than 16 times the field.
void on_exhausted(inout Hit hit, float derivative) {
    float pixel = min(16.0 * contact_share, 1.0) * u_pixel;
#ifdef ORTHOGRAPHIC
    hit.found = hit.residual < pixel && derivative <= 0.0;
#else
    hit.found = hit.residual < pixel * hit.t && derivative <= 0.0;
#endif
}
