// A Phong material.
struct Material {
    vec3 color;
    float shininess;
    float specular;
    float ambient;
};
