// What a ray found, and what it took.
// needs: field Ray u_pixel
// gives: Hit settle
struct Hit {
    bool found;
    float side;  // -1 if the ray started inside a solid, else 1
    float t;
    float residual;
    float iterations;
    float evaluations;
};

// The last step towards a surface: a secant step along the slope of the last two samples takes out most of the
// residual. Where the ray grazes, the step is long and the slope may come from a surface that the ray only passes;
// a step of more than half a pixel must therefore prove itself by a smaller residual.
void settle(inout Hit hit, Ray ray, float slope) {
    if (slope >= 0.0) return;
    float step_length = min(hit.residual / -slope, hit.t);
    if (step_length > 0.5 * u_pixel * hit.t) {
        float r = field(ray.origin + (hit.t + step_length) * ray.direction);
        hit.evaluations += 1.0;
        if (abs(r) >= hit.residual) return;
        hit.residual = abs(r);
    }
    hit.t += step_length;
}
