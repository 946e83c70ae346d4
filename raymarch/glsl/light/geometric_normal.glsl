// The normal of the solid, which is the one that is lit where no map bends it.
// needs: Surface
// gives: geometric_normal
vec3 geometric_normal(Surface surface) {
    return surface.normal;
}
