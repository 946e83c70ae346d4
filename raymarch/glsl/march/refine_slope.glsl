// A ray ends at the first sample within an epsilon of a surface, with one final step along the measured derivative. The
// field is not evaluated there, so the step is not verified: rays that only pass an edge count as hits too.
// needs: Ray Hit
// gives: refine_hit
bool refine_hit(inout Hit hit, Ray ray, float t, float r, float derivative) {
    hit.t = derivative < 0.0 ? t + min(r / -derivative, t) : t;
    hit.residual = abs(r);
    hit.found = true;
    return true;
}
