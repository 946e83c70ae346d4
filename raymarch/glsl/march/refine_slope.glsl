// A ray ends at the first sample that is within an epsilon of a surface, with one last step along the measured derivative.
// The field is not asked there, so that nothing proves the step: rays that only pass an edge count as hits too.
// needs: Ray Hit
// gives: refine_hit
bool refine_hit(inout Hit hit, Ray ray, float t, float r, float derivative) {
    hit.t = derivative < 0.0 ? t + min(r / -derivative, t) : t;
    hit.residual = abs(r);
    hit.found = true;
    return true;
}
