// A dielectric that transmits light: transmission, index of refraction, and absorption per unit of length; and its
// Fresnel reflectance, 1 beyond the critical angle.
struct Glass {
    float transmission;
    float ior;
    vec3 absorption;
};

// Unpolarised reflectance; `ratio` is the index of refraction on the incident side over that on the other.
float fresnel_dielectric(float cosine, float ratio) {
    float sine = ratio * ratio * (1.0 - cosine * cosine);
    if (sine >= 1.0) return 1.0;
    float beyond = sqrt(1.0 - sine);
    float upright = (ratio * cosine - beyond) / (ratio * cosine + beyond);
    float lying = (cosine - ratio * beyond) / (cosine + ratio * beyond);
    return 0.5 * (upright * upright + lying * lying);
}
