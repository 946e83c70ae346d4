// Light of the sky on a microfacet material. Diffuse part: the sky's mean times the transmittance of the interface.
// Specular part: the sky in the mirror direction, interpolated to its mean by roughness, times the directional albedo.
// The fraction of the reflection that secondary rays trace is left out.
vec3 specular_sky(Surface surface, float traced) {
    Material material = surface.material;
    float n_dot_v = clamp(dot(surface.normal, surface.view), 0.0, 1.0);
    vec3 reflected = reflect(-surface.view, surface.normal);
    vec3 around = mix(sky(reflected), sky_mean(reflected), material.roughness);
    vec2 fit = directional_albedo(n_dot_v, material.roughness);
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 back = f0 * fit.x + fit.y;
    vec3 diffuse = (1.0 - fit.y) * (1.0 - material.f0) * (1.0 - material.metalness);
    return (1.0 - traced) * around * back + sky_mean(surface.normal) * diffuse * material.color;
}
