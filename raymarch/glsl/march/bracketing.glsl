// Bracketing sphere tracing. A step goes to the expected tangent point of the next sphere, by an exponential average of
// the derivative (as in Bán and Valasek 2023). If the spheres do not overlap, the far one is kept and a plain step
// follows. Once a sphere reaches the kept one, the march goes on from there. A kept sphere inside the solid bounds the
// gap: the first surface lies before it.
#ifdef ADVANCE
// A sample that knows more than its sphere takes a step as long as the ray is free, see raymarch/sdf/advance.
#endif
float step_length(March at, float far) {
    float low = at.kept_t - abs(at.kept_r) - at.t;
    float z = min(2.0 * at.r / (1.0 - at.derivative), far - at.t + at.r);
    if (at.kept_t > 0.0 && z >= low) z = 0.5 * (at.r + low);  // into the gap
#ifdef ESTIMATE
    // Two spheres of an estimate that overlap prove nothing: what a longer step may miss is smaller than a pixel.
    z = min(z, at.r + pixel_at(at.t));
#endif
    return max(at.r, z);
}

#ifdef SKIPS
// The same for a ray that keeps no sphere, and whose step does not end beyond its range.
float free_step(March at) {
    float z = at.r / (0.5 * (1.0 - at.derivative));
#ifdef ESTIMATE
    z = max(at.r, min(z, at.r + pixel_at(at.t)));
#endif
    return z;
}

// `move`, where the step to the sample is certified to be empty.
void follow(inout March at, float t, float r, float derivative) {
    at.t = t;
    at.r = r;
    at.last_derivative = derivative;
    at.derivative = clamp(mix(at.derivative, derivative, smoothing), -1.0, 0.999);
#ifdef ADVANCE
    at.derivative = by_distance ? at.derivative : -1.0;
#endif
}

#endif
void move(inout March at, bool empty, float t, float r, float derivative) {
    float low = at.kept_t - abs(at.kept_r);
    bool met = empty && at.kept_t > t && t + r >= low && at.kept_r > 0.0;
    float to = met ? at.kept_t : t;
    at.t = empty ? to : at.t;
    at.r = empty ? (met ? at.kept_r : r) : at.r;
#ifdef ADVANCE
    at.kept_r = empty ? at.kept_r : min(r, way_behind);
#else
    at.kept_r = empty ? at.kept_r : r;
#endif
    at.kept_t = empty ? (low > to ? at.kept_t : 0.0) : t;
    at.last_derivative = empty && !met ? derivative : 0.0;
    // after a step that was too long: the steepest derivative, which gives a plain step
    at.derivative = empty ? clamp(mix(at.derivative, derivative, smoothing), -1.0, 0.999) : -1.0;
#ifdef ADVANCE
    at.derivative = by_distance ? at.derivative : -1.0;
#endif
}

// By how much more a step of length z may be longer near a surface, so that no more than `leap` of it is unproven if
// the derivative stays as it is. It does not lead beyond the surface that the derivative expects, and is 0 farther
// away: a thin sheet may lie between two spheres that do not overlap.
float further_step(March at, float z, float leap) {
#ifdef ESTIMATE
    return 0.0;
#else
    float m = at.last_derivative;
#ifdef ADVANCE
    if (at.derivative == -1.0) return 0.0;
#endif
    if (m == 0.0 || at.kept_t != 0.0 || at.r <= 0.0 || at.r > 3.0 * leap) return 0.0;
    float further = 0.95 * leap / (1.0 - at.derivative);
    return m < 0.0 ? clamp(at.r / -m - z, 0.0, further) : further;
#endif
}
