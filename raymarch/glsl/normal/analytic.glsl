// The normal from the analytic gradient.
vec3 surface_normal(vec3 p, vec3 direction) {
    return facing_normal(field_gradient(p).xyz, direction);
}
