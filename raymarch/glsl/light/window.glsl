// A light of an inverse square fades towards its radius, and is 0 beyond.
// needs:
// gives: range_window
float range_window(float far, float radius) {
    float x = far / radius;
    float rest = max(1.0 - x * x * x * x, 0.0);
    return rest * rest;
}
