// What a surface looks like where some are shaded after Phong and some by microfacets.
// needs:
// gives: Material
struct Material {
    vec3 color;
    float shininess;
    float specular;
    float ambient;
    float metalness;
    float roughness;
    vec3 f0;
    float physical;  // share of the second kind
};
