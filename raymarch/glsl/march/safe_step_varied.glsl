// The length of a plain step at a value of the field, at t along a ray: a fraction of the value that varies from pixel
// to pixel and from sample to sample. The error of an estimate then shows as noise, which accumulation averages out,
// and not as rings. Forwards it is at least an ulp of t, or the ray would stand still. A value above a threshold is
// more than that.
float safe_step(float r, float t) {
    float z = step_scale * (1.0 - step_variation * random_of_pixel(0)) * r;
    return r > 0.0 ? max(z, GROWTH * t) : z;
}
