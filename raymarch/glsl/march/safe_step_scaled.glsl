// The length of a plain step at a value of the field: a fixed fraction of the value, for fields that overestimate the
// distance.
float safe_step(float r) {
    return step_scale * r;
}
