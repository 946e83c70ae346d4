// The march of a ray: one evaluation of the field per turn, in two states. The ray searches with steps of the tracer
// until a sample is near a surface, then refines the hit with secant steps. `at` and `hit` hold the whole state. A
// refining step must reduce the residual. Along a surface the derivative is nearly 0, and a secant step could pass
// through an object that stands on the surface: the first is at most `leap_pixels` longer than a plain step, the next
// no longer than the distance over which the derivative has held. A ray that only passes a surface searches on from its
// last certified sample; as a hit it would widen silhouettes.
void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec3 widths = hit_widths(ray);
    bool found = false;
    bool escaped = false;
#ifndef UNCOUNTED
    float steps = 0.0;
#endif
    for (int i = 0; i < march_steps; i++) {
        float width = at.passing ? widths.z : widths.y;
        float leap = at.refining ? at.t - at.kept_t : 0.0;
#ifdef ORTHOGRAPHIC
        bool aiming = at.refining || aims_at_surface(at.r, at.last_derivative, widths.x * at.t + width);
        leap = leap_pixels * u_pixel + leap;
#else
        bool aiming = at.refining || aims_at_surface(at.r, at.last_derivative, widths.x + width * at.t);
        leap = leap_pixels * u_pixel * at.t + leap;
#endif
        float secant = at.last_derivative < 0.0 ? min(at.r / -at.last_derivative, at.r + leap) : at.r;
        float z = aiming ? secant : step_length(at, far);
        escaped = !at.refining && at.t + min(z, at.r) > far;
        if (escaped) break;
#ifndef UNCOUNTED
        steps += 1.0;
#endif
        float t = at.t + z;
        float next = march_distance(ray, t);
        float derivative = z != 0.0 ? (next - at.r) / z : at.derivative;
        bool empty = z <= at.r + abs(next);  // else the step may have passed a surface
        bool closer = abs(next) < abs(at.r);
        bool passed = at.refining && !closer;
#ifdef ORTHOGRAPHIC
        bool near = at.refining ? closer : next < widths.x * t + width && (empty || aiming);
#else
        bool near = at.refining ? closer : next < widths.x + width * t && (empty || aiming);
#endif
        float kept_t = at.refining ? at.kept_t : empty ? t : at.t;
        float kept_r = at.refining ? at.kept_r : empty ? next : at.r;
        at.refining = near;
        at.passing = at.passing || passed;
        if (near || passed) {
            at.t = near ? t : kept_t;
            at.r = near ? next : kept_r;
            at.last_derivative = near ? derivative : 0.0;
            at.kept_t = near ? kept_t : 0.0;
            at.kept_r = kept_r;
        } else {
            move(at, empty, t, next, derivative);
#ifndef UNCOUNTED
            hit.fallbacks += float(!empty);
#endif
        }
#ifdef ORTHOGRAPHIC
        found = near && abs(next) <= widths.x * t + hit_width(widths);
#else
        found = near && abs(next) <= widths.x + hit_width(widths) * t;
#endif
        if (found) break;
    }
#ifdef CLIP_PLANES
    escaped = escaped || (found && at.t > between_planes(ray, u_far).y);  // a long step may end behind the far plane
    found = found && !escaped;
#endif
#ifdef ANALYTIC
    escaped = escaped || (found && at.t > solved_t);  // a long step may end behind a hit in closed form
    found = found && !escaped;
#endif
    hit.done = found || escaped;
    hit.found = found;
    hit.t = found ? at.t + last_step(widths, at) : at.t;
    hit.residual = abs(at.r);
#ifndef UNCOUNTED
    hit.iterations += steps;
    hit.evaluations += steps;
#endif
    if (!hit.done) on_exhausted(hit, at.last_derivative);
}
