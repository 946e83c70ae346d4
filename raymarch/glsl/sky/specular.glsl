// The sky's light on a surface of microfacets. Matte: its mean, less what does not enter. Mirrored: between the sky that
// the mirror faces and its mean, by roughness, times what the facets give back in a white furnace; but for
// the share of the reflection whose way is followed.
// needs: Surface Material directional_albedo sky sky_mean
// gives: specular_sky
vec3 specular_sky(Surface surface, float followed) {
    Material material = surface.material;
    float n_dot_v = clamp(dot(surface.normal, surface.view), 0.0, 1.0);
    vec3 mirrored = reflect(-surface.view, surface.normal);
    vec3 around = mix(sky(mirrored), sky_mean(mirrored), material.roughness);
    vec2 fit = directional_albedo(n_dot_v, material.roughness);
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 back = f0 * fit.x + fit.y;
    vec3 inside = (1.0 - fit.y) * (1.0 - material.f0) * (1.0 - material.metalness);
    return (1.0 - followed) * around * back + sky_mean(surface.normal) * inside * material.color;
}
