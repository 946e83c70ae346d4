// A ray ends at the first sample within an epsilon of a surface, without refinement. For comparison.
// needs: Ray Hit
// gives: refine_hit
bool refine_hit(inout Hit hit, Ray ray, float t, float r, float derivative) {
    hit.t = t;
    hit.residual = abs(r);
    hit.found = true;
    return true;
}
