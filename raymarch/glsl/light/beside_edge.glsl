// The fraction of a disc that a straight edge leaves visible, at the fraction c of its radius from its middle, -1 to 1:
// 1/2 + (c sqrt(1 - c^2) + asin c) / pi.
float beside_edge(float edge) {
    float c = clamp(edge, -1.0, 1.0);
    return 0.5 + 0.31830989 * (c * sqrt(1.0 - c * c) + asin(c));
}
