// Samples a direction of a metal: single scattering and the diffuse part, or multiple scattering between microfacets.
// On smooth surfaces the lobe of the latter is narrow at the horizon, and so is its sampling density.
bool from_metal(Surface surface, int dimension, out vec3 direction, inout vec3 weight) {
    Material material = surface.material;
    vec3 albedo = multiscatter_albedo(surface);
    float several = dot(albedo, vec3(0.33333333));
    float once = 1.0 - material.metalness * missing_albedo(dot(surface.normal, surface.view), material.roughness);
    float chance = several / (several + once);
    if (random_of_pixel(dimension + 6) >= chance) {
        weight /= 1.0 - chance;
        return sample_microfacet(surface, dimension, direction, weight);
    }
    float u = max(random_of_pixel(dimension + 1), 1.0e-6);
    float turn = 6.2831853 * random_of_pixel(dimension + 2);
    float power = 1.5 - material.roughness;
    float cosine = pow(u, power);
    float sine = sqrt(1.0 - cosine * cosine);
    direction = to_world(surface.normal, vec3(sine * cos(turn), sine * sin(turn), cosine));
    float lobe = missing_albedo(cosine, material.roughness) / mean_missing_albedo(material.roughness);
    weight *= albedo * (lobe * 2.0 * power * pow(u, 2.0 * power - 1.0) / chance);
    return true;
}
