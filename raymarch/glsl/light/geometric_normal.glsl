// The geometric normal, for materials without normal mapping: equal to the shading normal.
vec3 geometric_normal(Surface surface) {
    return surface.normal;
}
