// The BSDF of a material that interpolates a Phong and a microfacet material.
vec3 eval_bsdf(Surface surface, Light light, float visibility) {
    return mix(eval_phong(surface, light, visibility), eval_microfacet(surface, light, visibility), surface.material.physical);
}
