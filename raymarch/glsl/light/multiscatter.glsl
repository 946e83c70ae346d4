// Multiple scattering between the microfacets of a metal, for one light, times pi: a wide, reciprocal lobe. `albedo` is
// its directional albedo.
vec3 multiscatter(vec3 albedo, Surface surface, Light light, float visibility) {
    float n_dot_l = dot(surface.normal, light.direction);
    if (n_dot_l <= 0.0 || visibility <= 0.0) return vec3(0.0);
    float roughness = surface.material.roughness;
    float lobe = missing_albedo(n_dot_l, roughness) / mean_missing_albedo(roughness);
    return light.radiance * (visibility * n_dot_l * lobe) * albedo;
}
