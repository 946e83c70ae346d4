// Samples a direction of a microfacet material: its specular or its diffuse part, with a probability by their
// reflectance. Returns false if the sample carries no light.
bool sample_microfacet(Surface surface, int dimension, out vec3 direction, inout vec3 weight) {
    Material material = surface.material;
    float n_dot_v = max(dot(surface.normal, surface.view), 1.0e-4);
    float alpha = max(material.roughness * material.roughness, 1.0e-4);
    vec3 f0 = mix(material.f0, material.color, material.metalness);
    vec3 diffuse = (1.0 - material.metalness) * (1.0 - material.f0) * material.color;
    float specular = dot(fresnel_schlick(f0, n_dot_v), vec3(0.33333333));
    float diffuse_weight = (1.0 - albedo_f90(n_dot_v, material.roughness)) * dot(diffuse, vec3(0.33333333));
    // The offsets avoid a division by 0 for black; the clamp samples both parts.
    float chance = clamp((specular + 1.0e-6) / (specular + diffuse_weight + 2.0e-6), 0.05, 0.95);
    if (material.metalness >= 1.0) chance = 1.0;
    vec2 u = vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2));
    if (random_of_pixel(dimension) < chance) {
        vec3 h = sample_visible_normal(surface.normal, surface.view, alpha, u);
        direction = reflect(-surface.view, h);
        float n_dot_l = dot(surface.normal, direction);
        if (n_dot_l <= 0.0) return false;
        float to_eye = sqrt(alpha * alpha + (1.0 - alpha * alpha) * n_dot_v * n_dot_v);
        float unhidden = 2.0 * n_dot_l * (n_dot_v + to_eye) * v_smith(n_dot_l, n_dot_v, alpha);  // G2 / G1
        weight *= fresnel_schlick(f0, dot(surface.view, h)) * (unhidden / chance);
    } else {
        direction = sample_cosine(surface.normal, u);
        float n_dot_l = dot(surface.normal, direction);
        weight *= diffuse * (interface_transmittance(n_dot_l, n_dot_v, material.roughness) / (1.0 - chance));
    }
    return true;
}
