// A ray ends at the first sample within an epsilon of a surface, with one final step along the measured derivative. The
// field is not evaluated there, so the step is not verified: rays that only pass an edge count as hits too.
float hit_width(vec3 widths) {
    return widths.y;
}

bool refined(vec3 widths, float t, float r, float derivative) {
    return abs(r) <= width_at(widths, hit_width(widths), t);
}

float last_step(vec3 widths, March at) {
    return at.last_derivative < 0.0 ? min(at.r / -at.last_derivative, at.t) : 0.0;
}
