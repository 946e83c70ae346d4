// A microfacet material.
struct Material {
    vec3 color;
    float metalness;
    float roughness;
    vec3 f0;
};
