// A dielectric that transmits light.
struct Glass {
    float transmission;
    float ior;
    vec3 absorption;  // per unit of length
};
