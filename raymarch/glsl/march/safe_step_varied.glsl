// The length of a plain step at a value of the field, at t along a ray: a fraction of the value that varies from pixel to
// pixel and from sample to sample. The error of an estimate then shows as noise, which accumulation averages out, and
// not as rings. It is at least an ulp of t, or the ray would stand still. The value is more than that, because
// thresholds are.
float safe_step(float r, float t) {
    return max(step_scale * (1.0 - step_variation * random_of_pixel(0)) * r, GROWTH * t);
}
