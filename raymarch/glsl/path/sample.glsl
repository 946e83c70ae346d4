// A random direction of a BSDF.
struct BsdfSample {
    vec3 direction;
    vec3 weight;  // BSDF times cosine over density
};
