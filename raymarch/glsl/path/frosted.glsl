// Where the light that rough glass sends to the eye came from: one of its microfacets mirrors or bends it, by chance,
// each with its share after Fresnel (Walter et al. 2007). Facets are drawn among those that are seen; what others then
// hide is lost. False if no light comes that way. `side` changes where the light was bent.
// needs: Surface Glass facet_of reflectance random_of_pixel
// gives: from_frosted
bool from_frosted(Surface surface, Glass glass, int dimension, inout float side, out vec3 direction, inout vec3 weight) {
    float alpha = max(surface.material.roughness * surface.material.roughness, 1.0e-4);
    float square = alpha * alpha;
    vec2 u = vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2));
    vec3 h = facet_of(surface.normal, surface.view, alpha, u);
    float ratio = side > 0.0 ? 1.0 / glass.ior : glass.ior;
    if (random_of_pixel(dimension + 4) < reflectance(dot(h, surface.view), ratio)) {
        direction = reflect(-surface.view, h);
        float facing = dot(surface.normal, direction);
        if (facing <= 0.0) return false;
        float seen = max(dot(surface.normal, surface.view), 1.0e-4);
        float to_eye = sqrt(square + (1.0 - square) * seen * seen);
        float to_light = sqrt(square + (1.0 - square) * facing * facing);
        weight *= facing * (seen + to_eye) / (facing * to_eye + seen * to_light);  // G2 / G1
    } else {
        direction = refract(-surface.view, h, ratio);
        float facing = -dot(surface.normal, direction);
        if (facing <= 0.0) return false;
        weight *= 2.0 * facing / (facing + sqrt(square + (1.0 - square) * facing * facing));  // G1 beyond
        side = -side;
    }
    return true;
}
