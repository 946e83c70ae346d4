// The march of a ray: one evaluation of the field per turn, in two states. The ray searches with steps of the tracer
// until a sample is near a surface, then refines the hit with secant steps. `at` and `hit` hold the whole state. A
// refining step must reduce the residual. Along a surface the derivative is nearly 0, and a secant step could pass
// through an object that stands on the surface: it is at most `leap_pixels` longer than a plain step, and
// once the ray touches the surface, by as much more as the derivative has held. A ray that only passes a surface
// searches on from its last certified sample; as a hit it would widen silhouettes.
#ifdef CUTS
// Refining steps aim a little below the surface, so that most hits are samples inside the solid. The others are in
// doubt, see march/membrane.
#endif
void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec3 widths = hit_widths(ray);
#ifdef STRETCH
    begin_stretch(far - at.t);
#endif
    bool found = false;
    bool escaped = false;
#ifndef UNCOUNTED
    float steps = 0.0;
#endif
    for (int i = 0; i < march_steps; i++) {
        float width = at.passing ? widths.z : widths.y;
#ifdef ORTHOGRAPHIC
        bool aiming = at.refining || aims_at_surface(at.r, at.last_derivative, widths.x * at.t + width);
        float leap = leap_pixels * u_pixel;
        float touch = widths.x * at.t + hit_width(widths);
#else
        bool aiming = at.refining || aims_at_surface(at.r, at.last_derivative, widths.x + width * at.t);
#ifdef BOUNCES
        float leap = leap_pixels * secondary_pixel() * at.t;
#else
        float leap = leap_pixels * u_pixel * at.t;
#endif
        float touch = widths.x + hit_width(widths) * at.t;
#endif
        bool touching = at.refining && abs(at.r) <= touch;
        if (touching) leap += at.t - at.kept_t;
#ifdef CUTS
        float noise = rounding(ray, at.t);
        float depth = max(0.7 * touch + noise, 0.0);
        bool doubtful = in_doubt(at);
        bool first = abs(at.r) <= noise;  // the ray starts on a face of the scene's box
        float below = at.r + depth;
        float secant = at.last_derivative < 0.0 ? min(below / -at.last_derivative, below + leap) : at.r;
        float z = doubtful ? doubt_step(at, depth) : aiming ? secant : first ? depth : step_length(at, far);
#else
        float secant = at.last_derivative < 0.0 ? min(at.r / -at.last_derivative, at.r + leap) : at.r;
        float z = aiming ? secant : step_length(at, far);
#endif
        escaped = !at.refining && at.t + min(z, at.r) > far;
        if (escaped) break;
#ifndef UNCOUNTED
        steps += 1.0;
#endif
        float t = at.t + z;
        float next = march_distance(ray, t);
#ifdef CUTS
        if (doubtful) {
            found = enters(at, t, next, noise);
            if (found) break;
            continue;
        }
#endif
#ifdef CUTS
        float derivative = z != 0.0 && !(first && next > 0.0) ? (next - at.r) / z : at.derivative;
#ifdef ADVANCE
        bool empty = first || z <= at.r + way_behind;  // else the step may have passed a surface
#else
        bool empty = first || z <= at.r + abs(next);  // else the step may have passed a surface
#endif
#else
        float derivative = z != 0.0 ? (next - at.r) / z : at.derivative;
#ifdef ADVANCE
        bool empty = z <= at.r + way_behind;  // else the step may have passed a surface
#else
        bool empty = z <= at.r + abs(next);  // else the step may have passed a surface
#endif
#endif
        bool closer = abs(next) < abs(at.r);
        bool passed = at.refining && !closer;
#ifndef CUTS
        found = passed && touching;
        if (found) break;
#endif
#ifdef ORTHOGRAPHIC
        bool near = at.refining ? closer : next < widths.x * t + width && (empty || aiming);
#else
        bool near = at.refining ? closer : next < widths.x + width * t && (empty || aiming);
#endif
#ifdef CUTS
        bool unproven = near && next >= -noise && at.r >= -noise && next <= 2.0 * depth;
        if (unproven && (aiming || first || derivative < 0.0)) {
            doubt(at, t, next, derivative);
            continue;
        }
        near = near && !unproven;
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
        found = near && refined(widths, t, next, derivative);
#ifdef CUTS
        found = found || (near && abs(next) <= 2.0 * depth);
#endif
        if (found) break;
    }
#ifdef CLIP_PLANES
    escaped = escaped || (found && at.t > between_planes(ray, u_far).y);  // a long step may end behind the far plane
    found = found && !escaped;
#endif
#ifdef ANALYTIC
#ifdef CUTS
    escaped = escaped || (found && at.t + last_step(widths, at) > solved_t);
#else
    escaped = escaped || (found && at.t > solved_t);  // a long step may end behind a hit in closed form
#endif
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
