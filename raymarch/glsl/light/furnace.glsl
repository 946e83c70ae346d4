// What facets give back of even light from all around, as f0 times the first value plus the second. Fitted to the
// integral of GGX with correlated masking and Schlick's reflectance: off by 0.05 of it at most.
// needs:
// gives: furnace
vec2 furnace(float v, float r) {
    float lost = r * (0.445 - v * (0.2619 + 0.396 * v) + r * (1.2682 * v - 0.658 + 0.3441 * r));
    float even = 1.0207 + v * (0.1525 + v * (3.3888 * v - 6.5391));
    float rough = -2.0124 + v * (4.7975 + 7.5886 * v) + r * (0.376 - 6.2715 * v + 0.722 * r);
    float edge = clamp(exp2(-6.0 * v) * (even + r * rough), 0.0, 1.0);
    return vec2(max(1.0 - lost - edge, 0.0), edge);
}
