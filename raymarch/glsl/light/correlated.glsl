// Visibility term of microfacets, G2 / (4 n_dot_l n_dot_v): Smith masking for GGX, height-correlated (Heitz 2014).
float v_smith(float n_dot_l, float n_dot_v, float alpha) {
    float square = alpha * alpha;
    float rest = 1.0 - square;
    return 0.5 / (n_dot_l * sqrt(n_dot_v * n_dot_v * rest + square) + n_dot_v * sqrt(n_dot_l * n_dot_l * rest + square));
}
