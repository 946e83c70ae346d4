// A ray that runs out of steps shows the surface that it is near, at its last sample: never the sky, before which a
// solid may lie.
#ifdef ANALYTIC
// It shows a solid in closed form that lies behind, unless its last sample is within a pixel width of the surface and
// the ray does not rise from it. Where `contact_share` is below 1/16, the surface may be farther away than 16 times the
// field.
#endif
void on_exhausted(inout Hit hit, float derivative) {
#ifdef ANALYTIC
    hit.found = solved_t >= 1.0e30
        || derivative <= 0.0 && hit.residual < min(16.0 * contact_share, 1.0) * pixel_at(hit.t);
#else
    hit.found = true;
#endif
}
