// A light from one point that falls off as a polynomial of the distance says: constant, linear, quadratic.
// needs: Light
// gives: attenuated_light
Light attenuated_light(vec3 p, vec3 position, vec3 radiance, vec3 terms) {
    vec3 way = position - p;
    float far = max(length(way), 1.0842022e-19);
    float divisor = max(terms.x + far * (terms.y + far * terms.z), 1.1754944e-38);
    return Light(way / far, far, radiance / divisor);
}
