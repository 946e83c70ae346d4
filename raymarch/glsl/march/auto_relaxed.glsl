// Auto-relaxed sphere tracing (Bán and Valasek 2023): as the enhanced tracer, but with a slope averaged over the
// steps, and no factor to choose: the step is the whole way to where the spheres would touch. A step that proved too
// long forgets the slope and is taken again as a plain one.
// needs: March smoothing
// gives: stride remembered UNDONE
const float UNDONE = -1.0;  // the steepest slope, by which a step is a plain one

float stride(March at, float far) {
    return max(at.r, min(2.0 * at.r / (1.0 - at.slope), far - at.t + at.r));
}

float remembered(float before, float slope) {
    return clamp(mix(before, slope, smoothing), -1.0, 0.999);
}
