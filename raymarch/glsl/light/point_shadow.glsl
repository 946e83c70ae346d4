// Hard shadow of a point light: only what stands before the light is in its way.
// needs: shadow_ray
// gives: point_shadow
float point_shadow(vec3 p, vec3 normal, float t, vec3 position) {
    vec3 way = position - p;
    float far = length(way);
    return shadow_ray(p, normal, t, way / max(far, 1.1754944e-38), far);
}
