// The normal of the solid, which no map bends, on the side on which the bent one is.
// needs: Surface
// gives: geometric_normal
vec3 geometric_normal(Surface surface) {
    return dot(surface.normal, surface.geometric_normal) < 0.0 ? -surface.geometric_normal : surface.geometric_normal;
}
