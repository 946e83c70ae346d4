// The normal from the analytic gradient. Where the gradient vanishes, on a medial axis, the normal faces the ray.
// needs: field_gradient
// gives: surface_normal
vec3 surface_normal(vec3 p, vec3 direction) {
    vec3 g = field_gradient(p).xyz;
    float size = length(g);
    return size > 1.0e-12 ? g / size : -direction;
}
