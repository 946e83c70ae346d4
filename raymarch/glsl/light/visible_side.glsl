// The normal of the visible side. A hit may lie on the far side of a solid that is thinner than the width of a hit; the
// near side has the opposite normal. Normals that face away by less than a quarter are those of silhouettes.
vec3 visible_side(vec3 normal, vec3 direction) {
    return dot(normal, direction) > 0.25 ? -normal : normal;
}
