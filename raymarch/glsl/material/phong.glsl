// What a surface looks like, after Phong.
// needs:
// gives: Material
struct Material {
    vec3 color;
    float shininess;
    float specular;
    float ambient;
};
