// Auto-relaxed sphere tracing (Bán and Valasek 2023): as the enhanced tracer, but with a derivative averaged over the
// steps, and no factor to choose: the step is the whole way to where the spheres would touch. A step that proved too
// long forgets the derivative and is taken again as a plain one.
// needs: March smoothing
// gives: step_length averaged_derivative UNDONE
const float UNDONE = -1.0;  // the steepest derivative, by which a step is a plain one

float step_length(March at, float far) {
    return max(at.r, min(2.0 * at.r / (1.0 - at.derivative), far - at.t + at.r));
}

float averaged_derivative(float before, float derivative) {
    return clamp(mix(before, derivative, smoothing), -1.0, 0.999);
}
