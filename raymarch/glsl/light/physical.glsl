// Microfacet reflection of one light (Cook and Torrance 1982), plus a diffuse part that reflects only light that passes
// the interface. The result is multiplied by pi, as all radiance here.
vec3 eval_microfacet(Surface surface, Light light, float visibility) {
    float n_dot_l = dot(surface.normal, light.direction);
    if (n_dot_l <= 0.0 || visibility <= 0.0) return vec3(0.0);
    Material material = surface.material;
    float n_dot_v = max(dot(surface.normal, surface.view), 1.0e-4);
    vec3 half_vector = normalize(light.direction + surface.view);
    float alpha = max(material.roughness * material.roughness, 1.0e-3);
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 specular = fresnel_schlick(f0, dot(half_vector, surface.view))
        * (3.1415927 * d_ggx(surface.normal, half_vector, alpha) * v_smith(n_dot_l, n_dot_v, alpha));
    float transmittance = interface_transmittance(n_dot_l, n_dot_v, material.roughness) * (1.0 - material.metalness);
    return light.radiance * (visibility * n_dot_l) * (specular + transmittance * (1.0 - material.f0) * material.color);
}
