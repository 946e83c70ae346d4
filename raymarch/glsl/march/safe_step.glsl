// The length of a plain step at a value of the field, at t along a ray: the value itself.
float safe_step(float r, float t) {
    return r;
}
