// A ray ends at the first sample within an epsilon of a surface, without refinement.
// needs: March
// gives: hit_width last_step
float hit_width(vec3 widths) {
    return widths.y;
}

float last_step(vec3 widths, March at) {
    return 0.0;
}
