// Samples a direction of rough glass: reflection or refraction by a microfacet, chosen by the Fresnel reflectance
// (Walter et al. 2007). Microfacet normals are sampled among the visible ones; light that other microfacets block is
// lost. Returns false if the sample carries no light. A refraction changes the sign of `side`.
bool sample_rough_dielectric(Surface surface, Glass glass, int dimension, inout float side, out vec3 direction, inout vec3 weight) {
    float alpha = max(surface.material.roughness * surface.material.roughness, 1.0e-4);
    float square = alpha * alpha;
    vec2 u = vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2));
    vec3 h = sample_visible_normal(surface.normal, surface.view, alpha, u);
    float ratio = side > 0.0 ? 1.0 / glass.ior : glass.ior;
    if (random_of_pixel(dimension + 4) < fresnel_dielectric(dot(h, surface.view), ratio)) {
        direction = reflect(-surface.view, h);
        float n_dot_l = dot(surface.normal, direction);
        if (n_dot_l <= 0.0) return false;
        float n_dot_v = max(dot(surface.normal, surface.view), 1.0e-4);
        float to_eye = sqrt(square + (1.0 - square) * n_dot_v * n_dot_v);
        float to_light = sqrt(square + (1.0 - square) * n_dot_l * n_dot_l);
        weight *= n_dot_l * (n_dot_v + to_eye) / (n_dot_l * to_eye + n_dot_v * to_light);  // G2 / G1
    } else {
        direction = refract(-surface.view, h, ratio);
        float n_dot_l = -dot(surface.normal, direction);
        if (n_dot_l <= 0.0) return false;
        weight *= 2.0 * n_dot_l / (n_dot_l + sqrt(square + (1.0 - square) * n_dot_l * n_dot_l));  // G1 beyond
        side = -side;
    }
    return true;
}
