// The normal of the solid, which no map bends, on the side on which the bent one is.
// needs: Surface
// gives: unbent
vec3 unbent(Surface surface) {
    return dot(surface.normal, surface.outward) < 0.0 ? -surface.outward : surface.outward;
}
