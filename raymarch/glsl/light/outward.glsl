// The normal of the solid, which is the one that is lit where no map bends it.
// needs: Surface
// gives: unbent
vec3 unbent(Surface surface) {
    return surface.normal;
}
