// A light with an attenuation of its own fades evenly towards its radius, and is 0 beyond.
// needs:
// gives: linear_falloff
float linear_falloff(float far, float radius) {
    return max(1.0 - far / radius, 0.0);
}
