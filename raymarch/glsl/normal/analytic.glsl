// The normal from the analytic gradient.
// needs: field_gradient facing_normal
// gives: surface_normal
vec3 surface_normal(vec3 p, vec3 direction) {
    return facing_normal(field_gradient(p).xyz, direction);
}
