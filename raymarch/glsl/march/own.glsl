// The tracer of a function in a scene file: a step as long as it says. After a step that was undone the next is plain.
const float UNDONE = 2.0;  // no field has this derivative

float own_memory = 0.0;  // what the function keeps from sample to sample

float step_length(March at, float far) {
    if (at.r == 0.0) own_memory = 0.0;  // before the first sample of a ray
    bool undone = at.derivative >= UNDONE;
    vec2 next = own_step(at.r, undone ? -1.0 : at.derivative, undone ? 1.0 : 0.0, own_memory, at.t, far - at.t);
    if (at.r > 0.0 && !at.refining) own_memory = next.y;
    return !undone && at.r > 0.0 && next.x > 0.0 ? min(next.x, far - at.t + at.r) : at.r;
}

float averaged_derivative(float before, float derivative) {
    return derivative;
}
