// Directional albedo of single scattering by microfacets: f0 times the first component plus the second.
vec2 directional_albedo(float v, float r) {
    float whole = 1.0 - missing_albedo(v, r);
    float edge = min(albedo_f90(v, r), whole);
    return vec2(whole - edge, edge);
}
