// The part of the solid that a hit lies on.
struct Part {
    vec3 gradient;  // of the field
    Material material;
};
