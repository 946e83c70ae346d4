// The point just inside the solid under a hit, where materials are evaluated.
vec3 inner_point(vec3 p, vec3 normal, Hit hit, float travelled) {
    return p - inner_depth(p, hit, travelled) * normal;
}
