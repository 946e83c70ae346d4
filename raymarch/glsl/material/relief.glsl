// Relief of a material: the bump gradient, which is subtracted from the unit normal, and the ambient visibility.
struct Relief {
    vec3 bump_gradient;
    float ambient_visibility;
};
