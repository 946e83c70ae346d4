// The answer of a surface that is shaded after Phong in one share, and by microfacets in the other; of these, a part is
// the outside of glass.
// needs: Surface Light Glass phong physical glazed
// gives: answer glaze over_it glazed_share
Glass over_it = Glass(0.0, 1.5, vec3(0.0));
float glazed_share = 0.0;

// How much of the microfacets is the outside of a glass.
void glaze(Glass glass, float share) {
    over_it = glass;
    glazed_share = share;
}

vec3 answer(Surface surface, Light light, float visibility) {
    Surface outside = surface;
    outside.material = glazed(surface.material, over_it, glazed_share);
    return mix(phong(surface, light, visibility), physical(outside, light, visibility), surface.material.physical);
}
