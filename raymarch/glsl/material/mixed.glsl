// A material that interpolates a Phong and a microfacet material.
struct Material {
    vec3 color;
    float shininess;
    float specular;
    float ambient;
    float metalness;
    float roughness;
    vec3 f0;
    float physical;  // weight of the microfacet material
};
