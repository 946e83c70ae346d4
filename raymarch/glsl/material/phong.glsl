// A Phong material.
// needs:
// gives: Material
struct Material {
    vec3 color;
    float shininess;
    float specular;
    float ambient;
};
