// Plain sphere tracing (Hart 1996) with steps that are a different part of the distance from pixel to pixel and from
// sample to sample, so that the error of an estimate shows as noise, which accumulation resolves, and not as rings.
// needs: March step_scale step_variation random_of_pixel
// gives: stride remembered UNDONE
const float UNDONE = -1.0;  // no step is too long

float stride(March at, float far) {
    return step_scale * (1.0 - step_variation * random_of_pixel(0)) * at.r;
}

float remembered(float before, float slope) {
    return slope;
}
