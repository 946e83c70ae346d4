// What a ray found, and what it took.
// needs: field Ray u_pixel
// gives: Hit u_side missed nearer settle
uniform float u_side;  // -1 if the camera is inside a solid, else 1: the sign with which the field is marched

struct Hit {
    bool found;
    float t;
    float residual;
    float iterations;
    float evaluations;
    float fallbacks;  // steps that proved too long and were undone
    float certified;  // 1 if the field's promise rules out a surface before t
};

Hit missed(float near) {
    return Hit(false, near, 0.0, 0.0, 0.0, 0.0, 1.0);
}

// Keeps the sample with the smallest residual as seen from the camera: what a ray that runs out of steps falls back on.
void nearer(inout Hit hit, float t, float r) {
    if (hit.evaluations > 1.0 && r * hit.t >= hit.residual * t) return;
    hit.t = t;
    hit.residual = r;
}

// The last step towards a surface: a secant step along the slope of the last two samples takes out most of the
// residual. Where the ray grazes, the step is long and the slope may come from a surface that the ray only passes;
// a step of more than half a pixel must therefore prove itself by a smaller residual.
void settle(inout Hit hit, Ray ray, float t, float r, float slope) {
    hit.found = true;
    hit.t = t;
    hit.residual = abs(r);
    if (slope >= 0.0) return;
    float step_length = min(r / -slope, t);
    if (abs(step_length) > 0.5 * u_pixel * t) {
        float moved = field(ray.origin + (t + step_length) * ray.direction);
        hit.evaluations += 1.0;
        if (abs(moved) >= abs(r)) return;
        hit.residual = abs(moved);
    }
    hit.t += step_length;
}
