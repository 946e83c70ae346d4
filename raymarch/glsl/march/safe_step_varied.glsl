// How far a ray may step from a sample of the field: a part of what that says, which differs from pixel to pixel and from
// sample to sample, so that the error of an estimate shows as noise, which accumulation resolves, and not as rings.
// needs: step_scale step_variation random_of_pixel
// gives: safe_step
float safe_step(float r) {
    return step_scale * (1.0 - step_variation * random_of_pixel(0)) * r;
}
