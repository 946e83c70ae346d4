// Point light with inverse-square falloff.
// needs: Light
// gives: point_light
Light point_light(vec3 p, vec3 position, vec3 radiance) {
    vec3 way = position - p;
    float square = max(dot(way, way), 1.1754944e-38);
    float near = inversesqrt(square);
    return Light(way * near, square * near, radiance / square);
}
