// The cosine-weighted mean over the hemisphere of `missing_albedo`, for separable masking.
float mean_missing_albedo(float roughness) {
    float r = max(roughness, 1.0e-3);
    float square = r * r;
    float above = 6.9992 + r * (r * (54.3927 - 22.8858 * r) - 31.8371);
    return square * square * above / (1.0 + r * (0.8659 + r * (21.4558 * r - 12.5989)));
}
