// Sphere tracing (Hart 1996): each step is the distance itself, so no surface is passed.
const float UNDONE = -1.0;  // no step is too long

float step_length(March at, float far) {
    return safe_step(at.r, at.t);
}

float averaged_derivative(float before, float derivative) {
    return derivative;
}
