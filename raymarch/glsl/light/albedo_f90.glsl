// The share of even light from all around that facets give back beyond f0 (1 - this): what Schlick's (1 - cosine)^5 comes
// to on a rough surface. A fit to the integral of GGX with correlated masking; at most 0.003 below it, 0.03 above, and
// 0.1 above where the cosine is less than 0.1.
// needs:
// gives: albedo_f90
float albedo_f90(float v, float r) {
    return pow(max(1.0 - v, 0.0), 5.0 + r * (6.06 * r - 7.04)) / (1.0 + r * r * (6.6 + 17.43 * r));
}
