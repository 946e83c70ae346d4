// Where a march stands, and what it found.
// needs:
// gives: Hit March u_side start_march no_hit keep_closest
uniform float u_side;  // -1 if the camera is inside a solid, else 1: the sign with which the field is marched

// The state of a march: all that it needs to go on, also in a later pass.
struct March {
    float t;
    float r;  // the field there; meaningless before it is asked
    float derivative;  // of the field along the ray, averaged over the last steps; -1, the steepest, where it is not known
    float last_derivative;  // derivative of the last step alone
    vec3 front;  // of the bracketing tracer alone: up to where all is free; a kept sphere's middle (0: none) and radius
    bool asked;
    bool passing;  // near a surface, but not to meet it: from then on only contact counts
    bool must_step;  // its last steps met nothing: it takes one step before it looks again
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

// Keeps the sample with the smallest residual as seen from the camera: what a ray that runs out of steps falls back on.
void keep_closest(inout Hit hit, float t, float r) {
    float residual = abs(r);  // a sample deep inside a solid is not near its surface
    if (residual * hit.t >= hit.residual * t) return;
    hit.t = t;
    hit.residual = residual;
}
