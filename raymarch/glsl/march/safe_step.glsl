// The length of a plain step at a value of the field: the value itself.
float safe_step(float r) {
    return r;
}
