// The sky's light on a surface of microfacets. Matte: its mean, less what does not enter. Mirrored: between the sky that
// the mirror faces and its mean, by roughness, times the facets' reflectance in a white furnace as fitted by Karis (2014).
// needs: Surface Material fifth sky sky_mean
// gives: glossy_sky
vec3 glossy_sky(Surface surface) {
    Material material = surface.material;
    float seen = clamp(dot(surface.normal, surface.view), 0.0, 1.0);
    vec3 mirrored = reflect(-surface.view, surface.normal);
    vec3 around = mix(sky(mirrored), sky_mean(mirrored), material.roughness);
    vec4 r = material.roughness * vec4(-1.0, -0.0275, -0.572, 0.022) + vec4(1.0, 0.0425, 1.04, -0.04);
    float edge = min(r.x * r.x, exp2(-9.28 * seen)) * r.x + r.y;
    vec2 fit = vec2(-1.04, 1.04) * edge + r.zw;
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 back = clamp(f0 * fit.x + fit.y, 0.0, 1.0);
    vec3 entering = min((1.0 - fifth(1.0 - seen)) * (1.0 - material.f0), 1.0 - back) * (1.0 - material.metalness);
    return around * back + sky_mean(surface.normal) * entering * material.color;
}
