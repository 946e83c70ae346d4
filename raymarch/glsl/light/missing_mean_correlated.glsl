// The cosine-weighted mean over the hemisphere of `missing_albedo`, for correlated masking.
float mean_missing_albedo(float roughness) {
    float r = max(roughness, 1.0e-3);
    float square = r * r;
    return square * square * (9.1786 + r * (7.2436 * r - 13.3576)) / (1.0 + r * (7.9611 + r * (13.3432 * r - 17.1284)));
}
