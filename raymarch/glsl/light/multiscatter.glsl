// The light of one source that several facets of a metal mirror, one after the other, times pi: a wide lobe, the same with
// light and eye exchanged. `albedo` is the share of even light that it gives back.
// needs: Surface Light missing_albedo mean_missing_albedo
// gives: multiscatter
vec3 multiscatter(vec3 albedo, Surface surface, Light light, float visibility) {
    float n_dot_l = dot(surface.normal, light.direction);
    if (n_dot_l <= 0.0 || visibility <= 0.0) return vec3(0.0);
    float roughness = surface.material.roughness;
    float lobe = missing_albedo(n_dot_l, roughness) / mean_missing_albedo(roughness);
    return light.radiance * (visibility * n_dot_l * lobe) * albedo;
}
