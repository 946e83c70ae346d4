// The geometric normal, for materials with normal mapping, flipped to the side of the shading normal.
vec3 geometric_normal(Surface surface) {
    return dot(surface.normal, surface.geometric_normal) < 0.0 ? -surface.geometric_normal : surface.geometric_normal;
}
