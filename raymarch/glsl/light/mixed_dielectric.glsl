// The answer of a surface that is shaded after Phong in one share, and by microfacets in the other; of these, a part is
// the outside of glass.
// needs: Surface Light Glass eval_phong eval_microfacet as_dielectric
// gives: eval_bsdf set_dielectric over_it dielectric_share
Glass over_it = Glass(0.0, 1.5, vec3(0.0));
float dielectric_share = 0.0;

// How much of the microfacets is the outside of a glass.
void set_dielectric(Glass glass, float share) {
    over_it = glass;
    dielectric_share = share;
}

vec3 eval_bsdf(Surface surface, Light light, float visibility) {
    Surface outside = surface;
    outside.material = as_dielectric(surface.material, over_it, dielectric_share);
    return mix(eval_phong(surface, light, visibility), eval_microfacet(outside, light, visibility), surface.material.physical);
}
