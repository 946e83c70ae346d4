// Whether a way of light brings too little to be followed: less than half a step of 8 bits of what it meets.
// needs:
// gives: below_cutoff
bool below_cutoff(vec3 weight) {
    return max(max(weight.r, weight.g), weight.b) < 0.001953125;
}
