// A ray ends at the first sample within an epsilon of a surface, without refinement.
float hit_width(vec3 widths) {
    return widths.y;
}

float last_step(vec3 widths, March at) {
    return 0.0;
}
