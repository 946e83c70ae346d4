// Point light with inverse-square falloff.
Light point_light(vec3 p, vec3 position, vec3 radiance) {
    vec3 to_light = position - p;
    float square = max(dot(to_light, to_light), 1.1754944e-38);
    float near = inversesqrt(square);
    return Light(to_light * near, square * near, radiance / square);
}
