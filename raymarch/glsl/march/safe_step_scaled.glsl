// The length of a plain step at a value of the field, at t along a ray: a fixed fraction of the value, for fields that
// overestimate the distance. It is at least an ulp of t, or the ray would stand still. The value is more than that,
// because thresholds are.
float safe_step(float r, float t) {
    return max(step_scale * r, GROWTH * t);
}
