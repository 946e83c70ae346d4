// Density of microfacets that face along a direction: GGX (Walter et al. 2007). The sine comes from a cross product: near
// a mirror, 1 - cosine^2 would lose all its digits.
// needs:
// gives: facets
float facets(vec3 normal, vec3 middle, float alpha) {
    vec3 side = cross(normal, middle);
    float cosine = dot(normal, middle) * alpha;
    float spread = alpha / (dot(side, side) + cosine * cosine);
    return 0.31830989 * spread * spread;
}
