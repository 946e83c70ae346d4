// Random directions about a normal, each with the density that its function's name states.
vec3 to_world(vec3 normal, vec3 local) {
    // branchless orthonormal basis (Duff et al. 2017)
    float s = normal.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (s + normal.z);
    float b = normal.x * normal.y * a;
    vec3 tangent = vec3(1.0 + s * normal.x * normal.x * a, s * b, -s * normal.x);
    vec3 bitangent = vec3(b, s + normal.y * normal.y * a, -normal.y);
    return local.x * tangent + local.y * bitangent + local.z * normal;
}

// Density cosine / pi; u in [0, 1).
vec3 sample_cosine(vec3 normal, vec2 u) {
    float r = sqrt(u.x);
    float turn = 6.2831853 * u.y;
    return to_world(normal, vec3(r * cos(turn), r * sin(turn), sqrt(1.0 - u.x)));
}

// A visible GGX microfacet normal for `view`, by spherical caps (Dupuy and Benyoub 2023).
vec3 sample_visible_normal(vec3 normal, vec3 view, float alpha, vec2 u) {
    vec3 tangent = to_world(normal, vec3(1.0, 0.0, 0.0));
    vec3 bitangent = to_world(normal, vec3(0.0, 1.0, 0.0));
    vec3 v = vec3(dot(view, tangent), dot(view, bitangent), dot(view, normal));
    vec3 stretched = normalize(vec3(alpha * v.xy, v.z));
    float turn = 6.2831853 * u.x;
    float z = (1.0 - u.y) * (1.0 + stretched.z) - stretched.z;
    float s = sqrt(clamp(1.0 - z * z, 0.0, 1.0));
    vec3 h = vec3(s * cos(turn), s * sin(turn), z) + stretched;
    h = normalize(vec3(alpha * h.xy, max(h.z, 1.0e-7)));
    return h.x * tangent + h.y * bitangent + h.z * normal;
}
