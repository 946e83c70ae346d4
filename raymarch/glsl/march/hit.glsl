// The state of a march and its hit.
// needs:
// gives: Hit March u_side start_march no_hit keep_closest
uniform float u_side;  // -1 if the camera is inside a solid, else 1: multiplies the field

// The state of a march, from which a later pass can resume it.
struct March {
    float t;
    float r;  // the field at t; undefined before its first evaluation
    float derivative;  // of the field along the ray, averaged over the last steps; -1, the steepest, if unknown
    float last_derivative;  // over the last step alone
    vec3 front;  // of the bracketing tracer only: end of the empty part; kept sphere's centre (0: none) and radius
    bool asked;  // true if the field was evaluated at t
    bool passing;  // failed to refine a hit: from then on only `contact` triggers refinement
    bool must_step;  // refinement failed: one step is taken before the next try
};

struct Hit {
    bool done;  // false if the steps ran out
    bool found;
    float t;
    float residual;
    float iterations;
    float evaluations;
    float fallbacks;  // steps that proved too long and were undone
};

March start_march(float t) {
    return March(t, 0.0, -1.0, -1.0, vec3(0.0), false, false, false);
}

Hit no_hit(float near) {
    return Hit(true, false, near, 0.0, 0.0, 0.0, 0.0);
}

// Keeps the sample with the smallest residual relative to its distance. A ray that runs out of steps falls back on it.
void keep_closest(inout Hit hit, float t, float r) {
    float residual = abs(r);  // so that a sample deep inside a solid does not count as near
    if (residual * hit.t >= hit.residual * t) return;
    hit.t = t;
    hit.residual = residual;
}
