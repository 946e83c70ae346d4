// Auto-relaxed sphere tracing (Bán and Valasek 2023): as the enhanced tracer, but with an exponential average of the
// derivative over the steps and without a relaxation factor: a step goes all the way to the expected tangent point of
// the spheres. After a step that proved too long, the derivative is reset and a plain step is taken.
const float UNDONE = -1.0;  // the steepest derivative, which gives a plain step

float step_length(March at, float far) {
    return max(at.r, min(2.0 * at.r / (1.0 - at.derivative), far - at.t + at.r));
}

float averaged_derivative(float before, float derivative) {
    return clamp(mix(before, derivative, smoothing), -1.0, 0.999);
}
