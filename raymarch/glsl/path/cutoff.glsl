// Whether the throughput of a ray is negligible: less than half a step of 8 bits of the radiance that it meets.
bool below_cutoff(vec3 weight) {
    return max(max(weight.r, weight.g), weight.b) < 0.001953125;
}
