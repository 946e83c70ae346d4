// The answer of a surface that is shaded after Phong in one share and by microfacets in the other.
// needs: Surface Light eval_phong eval_microfacet
// gives: eval_bsdf
vec3 eval_bsdf(Surface surface, Light light, float visibility) {
    return mix(eval_phong(surface, light, visibility), eval_microfacet(surface, light, visibility), surface.material.physical);
}
