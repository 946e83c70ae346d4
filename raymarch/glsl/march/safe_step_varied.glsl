// The length of a plain step at a value of the field: a fraction of the value that varies from pixel to pixel and from
// sample to sample. The error of an estimate then shows as noise, which accumulation averages out, and not as rings.
float safe_step(float r) {
    return step_scale * (1.0 - step_variation * random_of_pixel(0)) * r;
}
