// A material whose BSDF for lights blends that of a glass surface, by `share`, with its own. Schlick's reflectance is
// linear in f0, and the diffuse part in the colour, so these two are blended.
Material as_dielectric(Material material, Glass glass, float share) {
    vec3 own = mix(material.f0, material.color, material.metalness);
    vec3 diffuse = (1.0 - share) * (1.0 - material.metalness) * (1.0 - material.f0) * material.color;
    material.f0 = mix(own, vec3(fresnel_dielectric(1.0, 1.0 / glass.ior)), share);
    material.color = diffuse / max(1.0 - material.f0, 1.0e-6);
    material.metalness = 0.0;
    return material;
}
