// What light goes through: the share that does, the index of refraction, and how much a unit of length absorbs. By chance
// the light is mirrored or bent, each with its share after Fresnel; beyond the critical angle all of it is mirrored.
// needs:
// gives: Glass fresnel_dielectric
struct Glass {
    float transmission;
    float ior;
    vec3 absorption;
};

// Unpolarised, for a cosine on the side of the light and the ratio of the index there to that beyond.
float fresnel_dielectric(float cosine, float ratio) {
    float sine = ratio * ratio * (1.0 - cosine * cosine);
    if (sine >= 1.0) return 1.0;
    float beyond = sqrt(1.0 - sine);
    float upright = (ratio * cosine - beyond) / (ratio * cosine + beyond);
    float lying = (cosine - ratio * beyond) / (cosine + ratio * beyond);
    return 0.5 * (upright * upright + lying * lying);
}
