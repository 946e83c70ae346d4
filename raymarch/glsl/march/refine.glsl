// The end of a march: a hit has a residual of a small fraction of an epsilon, and the surface is less than three
// eighths of an epsilon away along the ray. The last step, along the derivative, goes there. It is no longer, so that
// no hit lies deeper in a solid, or half an epsilon beyond an edge.
float hit_width(vec3 widths) {
    return widths.z;
}

float longest_last_step(vec3 widths, float t) {
    return 0.375 * width_at(widths, widths.y, t);
}

bool refined(vec3 widths, float t, float r, float derivative) {
#ifdef EDGES
    if (edge_width > 0.0) return true;
#endif
    float near = derivative < 0.0 ? -derivative * longest_last_step(widths, t) : 1.0e30;
#ifdef ORTHOGRAPHIC
    return abs(r) <= widths.x * t + min(hit_width(widths), near);
#else
    return abs(r) <= widths.x + min(hit_width(widths) * t, near);
#endif
}

float last_step(vec3 widths, March at) {
    float most = longest_last_step(widths, at.t);
#ifdef CUTS
    float least = -1.0e30;  // the sample before a sample inside was outside
#else
    float least = -most;
#endif
    return at.last_derivative < 0.0 ? clamp(at.r / -at.last_derivative, least, most) : 0.0;
}
