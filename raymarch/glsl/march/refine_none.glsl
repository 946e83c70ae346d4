// A ray ends at the first sample within an epsilon of a surface, without refinement.
float hit_width(vec3 widths) {
    return widths.y;
}

bool refined(vec3 widths, float t, float r, float derivative) {
    return abs(r) <= width_at(widths, hit_width(widths), t);
}

float last_step(vec3 widths, March at) {
    return 0.0;
}
