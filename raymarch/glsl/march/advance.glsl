// The steps of a tracer that keeps no sphere but the last.
// Moves to a sample if the step to it is certified to be `empty`. Else the step is undone, and the derivative `UNDONE`
// reports this to the tracer.
void move(inout March at, bool empty, float t, float r, float derivative) {
    at.t = empty ? t : at.t;
    at.r = empty ? r : at.r;
    at.last_derivative = empty ? derivative : min(UNDONE, 0.0);
    at.derivative = empty ? averaged_derivative(at.derivative, derivative) : UNDONE;
}

// Such tracers step as published.
float further_step(March at, float z, float leap) {
    return 0.0;
}
