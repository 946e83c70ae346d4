// Directional albedo of GGX microfacets for Schlick's factor (1 - cosine)^5, the part of the reflectance beyond f0. A
// fit to the integral with correlated masking. Error: at most 0.003 below the integral and 0.03 above, and 0.1 above
// where the cosine is less than 0.1.
float albedo_f90(float v, float r) {
    return pow(max(1.0 - v, 0.0), 5.0 + r * (6.06 * r - 7.04)) / (1.0 + r * r * (6.6 + 17.43 * r));
}
