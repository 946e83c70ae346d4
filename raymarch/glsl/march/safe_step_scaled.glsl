// How far a ray may step from a sample of the field: a part of what that says, for fields that say too much.
// needs: step_scale
// gives: safe_step
float safe_step(float r) {
    return step_scale * r;
}
