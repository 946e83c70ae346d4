// Steps as long as the ray is known to be free, see raymarch/sdf/advance. Where only the value of the field tells how
// far that is, a step goes to the expected tangent point of the next sphere, as in auto-relaxed sphere tracing (Bán and
// Valasek 2023). It is undone if the next sample does not prove that the gap is empty.
const float UNDONE = -1.0;  // the steepest derivative, which gives a step as long as the ray is free

float step_length(March at, float far) {
    return max(at.r, min(2.0 * at.r / (1.0 - at.derivative), far - at.t + at.r));
}

float averaged_derivative(float before, float derivative) {
    return by_distance ? clamp(mix(before, derivative, smoothing), -1.0, 0.999) : UNDONE;
}
