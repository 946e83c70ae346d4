// The BSDF of a material that interpolates a Phong and a microfacet material. A share of the microfacet part is the
// outer surface of glass.
Glass over_it = Glass(0.0, 1.5, vec3(0.0));
float dielectric_share = 0.0;

// Sets the glass, and its share of the microfacet part.
void set_dielectric(Glass glass, float share) {
    over_it = glass;
    dielectric_share = share;
}

vec3 eval_bsdf(Surface surface, Light light, float visibility) {
    Surface outside = surface;
    outside.material = as_dielectric(surface.material, over_it, dielectric_share);
    return mix(eval_phong(surface, light, visibility), eval_microfacet(outside, light, visibility), surface.material.physical);
}
