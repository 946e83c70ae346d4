// A ray ends at the first sample that is within an epsilon of a surface: no last step. To compare.
// needs: Ray Hit
// gives: refine_hit
bool refine_hit(inout Hit hit, Ray ray, float t, float r, float derivative) {
    hit.t = t;
    hit.residual = abs(r);
    hit.found = true;
    return true;
}
