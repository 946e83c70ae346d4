// A light from one point; it falls off with the inverse square of the distance.
// needs: Material phong
// gives: point_light
vec3 point_light(
    Material material, vec3 p, vec3 normal, vec3 view, vec3 position, vec3 radiance, float visibility) {
    vec3 way = position - p;
    float square = max(dot(way, way), 1.1754944e-38);
    return phong(material, normal, view, way * inversesqrt(square), radiance / square, visibility);
}
