// A ray ends at the first sample within an epsilon of a surface, without refinement.
float hit_width(vec3 widths) {
    return widths.y;
}

bool refined(vec3 widths, float t, float r, float derivative) {
#ifdef ORTHOGRAPHIC
    return abs(r) <= widths.x * t + hit_width(widths);
#else
    return abs(r) <= widths.x + hit_width(widths) * t;
#endif
}

float last_step(vec3 widths, March at) {
    return 0.0;
}
