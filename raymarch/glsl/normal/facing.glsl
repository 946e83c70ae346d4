// The unit vector along a gradient. Where the gradient vanishes, on a medial axis, the normal faces the ray.
vec3 facing_normal(vec3 gradient, vec3 direction) {
    float size = length(gradient);
    return size > 1.0e-12 ? gradient / size : -direction;
}
