// What facets give back of even light from all around, as f0 times the first value plus the second. Fitted to the
// integral of GGX with correlated masking and Schlick's reflectance: off by 0.05 of it at most.
// needs: grazing
// gives: furnace
vec2 furnace(float v, float r) {
    float lost = r * (0.445 - v * (0.2619 + 0.396 * v) + r * (1.2682 * v - 0.658 + 0.3441 * r));
    float edge = grazing(v, r);
    return vec2(max(1.0 - lost - edge, 0.0), edge);
}
