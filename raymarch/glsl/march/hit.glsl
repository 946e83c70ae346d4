// The state of a march and its hit.
#ifdef OWN_START
float u_side = 1.0;  // -1 if the ray of this pixel starts inside a solid, else 1: multiplies the field
#else
uniform float u_side;  // -1 if the camera is inside a solid, else 1: multiplies the field
#endif

struct March {
    float t;  // the ray is certified to be empty up to t + r, unless it is refining a hit
    float r;  // the field at t; 0 before its first evaluation
    float kept_t;  // refining: the last certified sample; else a sample that may lie behind a surface; 0: none
    float kept_r;
    float derivative;  // of the field along the ray, averaged over the last steps
    float last_derivative;  // over the last step alone; 0 if unknown
    bool refining;
    bool passing;  // a refinement has failed: from then on only `contact` starts another
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

Hit no_hit(float near) {
    return Hit(true, false, near, 0.0, 0.0, 0.0, 0.0);
}
