// Range window of an inverse-square light: 1 at the light, 0 from its range on.
float range_window(float far, float radius) {
    float x = far / radius;
    float rest = max(1.0 - x * x * x * x, 0.0);
    return rest * rest;
}
