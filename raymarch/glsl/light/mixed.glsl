// The answer of a surface that is shaded after Phong in one share and by microfacets in the other.
// needs: Surface Light phong physical
// gives: answer
vec3 answer(Surface surface, Light light, float visibility) {
    return mix(phong(surface, light, visibility), physical(surface, light, visibility), surface.material.physical);
}
