// GGX distribution of microfacet normals (Walter et al. 2007). The sine comes from a cross product, because 1 -
// cosine^2 would lose all digits for a nearly smooth surface.
float d_ggx(vec3 normal, vec3 half_vector, float alpha) {
    vec3 side = cross(normal, half_vector);
    float cosine = dot(normal, half_vector) * alpha;
    float spread = alpha / (dot(side, side) + cosine * cosine);
    return 0.31830989 * spread * spread;
}
