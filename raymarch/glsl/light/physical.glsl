// The light of one source that a surface sends to the eye, by microfacets (Cook and Torrance 1982) over a diffuse part
// that gives off no more than what they let in. Times pi, as all brightness is counted.
// needs: Surface Light Material fresnel facets masking entering
// gives: physical
vec3 physical(Surface surface, Light light, float visibility) {
    float facing = dot(surface.normal, light.direction);
    if (facing <= 0.0 || visibility <= 0.0) return vec3(0.0);
    Material material = surface.material;
    float seen = max(dot(surface.normal, surface.view), 1.0e-4);
    vec3 middle = normalize(light.direction + surface.view);
    float alpha = max(material.roughness * material.roughness, 1.0e-3);
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 mirrored = fresnel(f0, dot(middle, surface.view))
        * (3.1415927 * facets(surface.normal, middle, alpha) * masking(facing, seen, alpha));
    float inside = entering(facing, seen, material.roughness) * (1.0 - material.metalness);
    return light.radiance * (visibility * facing) * (mirrored + inside * (1.0 - material.f0) * material.color);
}
