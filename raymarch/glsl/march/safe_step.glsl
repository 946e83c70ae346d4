// How far a ray may step from a sample of the field: as far as that says.
// needs:
// gives: safe_step
float safe_step(float r) {
    return r;
}
