// A ray ends at the first sample that is within an epsilon of a surface: no last step. To compare.
// needs: Ray Hit
// gives: settle
bool settle(inout Hit hit, Ray ray, float t, float r, float slope) {
    hit.t = t;
    hit.residual = abs(r);
    hit.found = true;
    return true;
}
