// The end of a march: a hit has a residual of a small fraction of an epsilon. The last step, along the derivative,
// removes nearly all of that. It is at most half an epsilon, so that no hit lies deeper in a solid.
float hit_width(vec3 widths) {
    return widths.z;
}

float last_step(vec3 widths, March at) {
#ifdef ORTHOGRAPHIC
    float most = 0.5 * (widths.x * at.t + widths.y);
#else
    float most = 0.5 * (widths.x + widths.y * at.t);
#endif
    return at.last_derivative < 0.0 ? clamp(at.r / -at.last_derivative, -most, most) : 0.0;
}
