// The length of a plain step at a value of the field, at t along a ray: a fixed fraction of the value, for fields that
// overestimate the distance. Forwards it is at least an ulp of t, or the ray would stand still. A value above
// a threshold is more than that.
float safe_step(float r, float t) {
    float z = step_scale * r;
    return r > 0.0 ? max(z, GROWTH * t) : z;
}
