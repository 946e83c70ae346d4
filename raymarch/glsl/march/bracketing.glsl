// Bracketing sphere tracing. A step goes to the expected tangent point of the next sphere, by an exponential average of
// the derivative (as in Bán and Valasek 2023). If the spheres do not overlap, the far one is kept and a shorter step
// follows. Once a sphere reaches the kept one, the march goes on from there. A kept sphere inside the solid bounds the
// gap: the first surface lies before it.
const float SHORTER = 0.3;  // share of the mean derivative after a step that was too long; the rest: a plain step

float step_length(March at, float far) {
    float low = at.kept_t - abs(at.kept_r) - at.t;
    // a little less than 2, because the spheres of a plane would just touch, and rounding would decide whether they do
    float z = min(1.998 * at.r / (1.0 - at.derivative), far - at.t + at.r);
    if (at.kept_t > 0.0 && z >= low) z = 0.5 * (at.r + low);  // into the gap
    return max(at.r, z);
}

void move(inout March at, bool empty, float t, float r, float derivative) {
    float low = at.kept_t - abs(at.kept_r);
    bool met = empty && at.kept_t > t && t + r >= low && at.kept_r > 0.0;
    float to = met ? at.kept_t : t;
    float share = r > 0.1 * at.r ? SHORTER : 0.0;  // no sphere that is tiny beside this one: a surface is close to it
    float slope = empty ? mix(at.derivative, derivative, smoothing) : mix(-1.0, at.derivative, share);
    at.derivative = clamp(slope, -1.0, 0.999);
    at.last_derivative = derivative;
    at.t = empty ? to : at.t;
    at.r = empty ? (met ? at.kept_r : r) : at.r;
    at.kept_r = empty ? at.kept_r : r;
    at.kept_t = empty ? (low > to ? at.kept_t : 0.0) : t;
}
