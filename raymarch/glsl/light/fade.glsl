// Linear falloff of a light with an attenuation: 1 at the light, 0 from its range on.
float linear_falloff(float far, float radius) {
    return max(1.0 - far / radius, 0.0);
}
