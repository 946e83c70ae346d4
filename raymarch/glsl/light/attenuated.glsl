// Point light with an attenuation: the radiance is divided by a quadratic polynomial of the distance. `terms` holds the
// constant, linear and quadratic coefficients.
Light attenuated_light(vec3 p, vec3 position, vec3 radiance, vec3 terms) {
    vec3 to_light = position - p;
    float far = max(length(to_light), 1.0842022e-19);
    float divisor = max(terms.x + far * (terms.y + far * terms.z), 1.1754944e-38);
    return Light(to_light / far, far, radiance / divisor);
}
