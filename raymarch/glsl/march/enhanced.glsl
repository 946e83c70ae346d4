// Enhanced sphere tracing (Bálint and Valasek 2018): a step to where the next sphere would touch this one if the
// surface were the plane through the last two samples, times a relaxation factor. The first step is plain, because no
// derivative is known. Where the ray recedes from the plane, the step ends at the far end of the range. After a step
// that proved too long, the plain step that replaces it counts as the previous one.
const float UNDONE = -1.0;  // the steepest derivative, which gives a plain step

float step_length(March at, float far) {
    // With the derivative m = (r - r_before) / d, (d - r_before + r) / (d + r_before - r) = (1 + m) / (1 - m).
    float z = at.r + relaxation * at.r * (1.0 + at.derivative) / max(1.0 - at.derivative, 1.0e-6);
    return max(at.r, min(z, far - at.t + at.r));
}

float averaged_derivative(float before, float derivative) {
    return clamp(derivative, -1.0, 1.0);
}
