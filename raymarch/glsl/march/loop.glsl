// The march of a ray: one evaluation of the field per turn, in two states. The ray searches with steps of the tracer
// until a sample is near a surface, then refines the hit with secant steps. `at` and `hit` hold the whole state.
// A sample proves a sphere empty, or full. Between the spheres at both ends of a step near a surface at most
// `leap_pixels` of the ray remain unproven, so that no ray passes a solid over a longer way; else the step is undone. A
// refining step goes to where the derivative expects the surface, as far as that rule lets it, and must come nearer.
// Once a sample is inside, the surface lies before it. A ray that only passes a surface searches on from the last
// sample that left nothing unproven, as a thin sheet may lie behind it; as a hit it would widen silhouettes.
#ifdef CUTS
// Refining steps aim a little below the surface, so that most hits are samples inside the solid. The others are in
// doubt, see march/membrane.
#endif
void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec3 widths = hit_widths(ray);
#ifdef NOTED
    note_sample(at.t, at.r, at.r, STARTS);
#endif
    bool found = false;
    bool escaped = false;
#ifndef UNCOUNTED
    float steps = 0.0;
#endif
#ifdef PUBLISHED
    // as Bálint and Valasek (2018) count: an undone step and the plain one that replaces it are one step
    for (int i = 0; i < march_steps + int(hit.fallbacks); i++) {
#else
#ifdef RISING
    // a ray that rises from a surface goes on: it has passed it
    for (int i = 0; i < march_steps || (i < rising_steps && at.last_derivative >= 0.0 && !at.refining); i++) {
#else
    for (int i = 0; i < march_steps; i++) {
#endif
#endif
#ifdef EDGES
        found = edge_width > 0.0 && is_expected(at);
        if (found) break;
#endif
        float width = at.passing ? widths.z : widths.y;
#ifdef ORTHOGRAPHIC
        bool aiming = at.refining || aims_at_surface(at.r, at.last_derivative, widths.x * at.t + width);
#ifdef BOUNCES
        float leap = leap_pixels * secondary_pixel();
#else
        float leap = leap_pixels * u_pixel;
#endif
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
        float longest = (2.0 * at.r + 0.95 * leap) / (1.0 - min(at.last_derivative, 0.0));
        float search = step_length(at, far);
        float further = aiming ? 0.0 : further_step(at, search, leap);
        if (!aiming && further == 0.0) leap = 0.0;
#ifdef CUTS
        float noise = noise_of(ray, at.t);
        search = max(search, 2.0 * GROWTH * at.t);  // a flat field may be smaller than the ulp of t
        leap = max(leap, 4.0 * GROWTH * at.t);
        float depth = max(0.7 * touch + noise, 0.0);
        bool doubtful = in_doubt(at);
#ifdef ADVANCE
        bool first = at.r <= 0.0 && at.r >= -2.0 * noise;  // the ray starts on a face of the scene's box
        float rate = approach;
#else
        bool first = abs(at.r) <= noise;  // the ray starts on a face of the scene's box
#endif
        float below = at.r + depth;
        float reach = longest_last_step(widths, at.t);
        float secant = at.last_derivative < 0.0 ? min(below / -at.last_derivative, depth + longest) : at.r;
        float z = doubtful ? doubt_step(at, depth, reach) : aiming ? secant : first ? depth : search + further;
#else
        float secant = at.last_derivative < 0.0 ? min(at.r / -at.last_derivative, longest) : at.r;
        float z = aiming ? secant : search + further;
#endif
        escaped = !at.refining && at.t + min(z, at.r) > far;
        if (escaped) break;
#ifndef UNCOUNTED
        steps += 1.0;
#endif
        float t = at.t + z;
        float next = march_distance(ray, t);
#ifdef NOTED
#ifdef ADVANCE
        note_sample(t, next, next < 0.0 ? next : way_behind, at.refining ? REFINES : SEARCHES);
#else
        note_sample(t, next, next, at.refining ? REFINES : SEARCHES);
#endif
#endif
#ifdef CUTS
        if (doubtful) {
#ifdef ADVANCE
            found = enters_ahead(at, t, noise);
#else
            found = enters(at, t, next, noise);
#endif
            if (found) break;
            continue;
        }
#endif
#ifdef ADVANCE
        float behind = way_behind;  // proven before the sample, by the sphere or more
#else
        float behind = abs(next);
#endif
        bool between = at.refining && at.r < 0.0;  // the last sample is inside, so the surface lies before it
#ifdef CUTS
        float derivative = z != 0.0 && !(first && next > 0.0) ? (next - at.r) / z : at.derivative;
        bool empty = first || between || z <= at.r + behind + leap;  // else the step may have passed a surface
        bool certain = first || z <= at.r + behind;
#else
        float derivative = z != 0.0 ? (next - at.r) / z : at.derivative;
        bool empty = between || z <= at.r + behind + leap;  // else the step may have passed a surface
        bool certain = z <= at.r + behind;
#endif
        if (between && next < 0.0) derivative = (next - at.kept_r) / (t - at.kept_t);
#ifdef ORTHOGRAPHIC
        bool near = empty && (at.refining ? next < abs(at.r) : next < widths.x * t + width);
#else
        bool near = empty && (at.refining ? next < abs(at.r) : next < widths.x + width * t);
#endif
        bool passed = at.refining && !near;
#ifdef NOTED
        if (!empty || passed) note_kind(IS_UNDONE); else if (near) note_kind(REFINES);
#endif
#ifndef CUTS
        found = passed && touching;
        if (found) break;
#endif
#ifdef CUTS
#ifdef ADVANCE
        noise = noise_of(ray, t);  // a step may be long
#ifdef ORTHOGRAPHIC
        depth = max(0.7 * (widths.x * t + hit_width(widths)) + noise, 0.0);
#else
        depth = max(0.7 * (widths.x + hit_width(widths) * t) + noise, 0.0);
#endif
        bool unproven = near ? next <= 2.0 * depth : empty && (aiming || first) && value_there <= 2.0 * depth;
        unproven = unproven && value_there >= -noise && at.r >= -2.0 * noise;
        if (unproven && (aiming || first || derivative < 0.0)) {
            doubt_ahead(at, t, derivative, rate, noise);
            continue;
        }
#else
        bool unproven = near && next >= -noise && at.r >= -noise && next <= 2.0 * depth;
        if (unproven && (aiming || first || derivative < 0.0)) {
            doubt(at, t, next, derivative);
            continue;
        }
#endif
        near = near && !unproven;
#endif
        at.passing = at.passing || passed;
        if (near || passed) {
            // the last sample up to which all is certainly empty
            bool follows = certain && next >= 0.0 && (!at.refining || at.t == at.kept_t);
            vec2 kept = follows ? vec2(t, next) : at.refining ? vec2(at.kept_t, at.kept_r) : vec2(at.t, at.r);
            at.t = near ? t : kept.x;
            at.r = near ? next : kept.y;
            at.derivative = empty ? at.derivative : -1.0;
            at.last_derivative = near ? derivative : 0.0;
            at.kept_t = near ? kept.x : 0.0;
            at.kept_r = kept.y;
            at.refining = near;
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
#ifdef ADVANCE
#ifdef ORTHOGRAPHIC
    if (found) hit.t += way_below_level(ray, at.t, widths.x * at.t + widths.y);
#else
    if (found) hit.t += way_below_level(ray, at.t, widths.x + widths.y * at.t);
#endif
#endif
    hit.residual = abs(at.r);
#ifndef UNCOUNTED
    hit.iterations += steps;
    hit.evaluations += steps;
#endif
    if (!hit.done) on_exhausted(hit, at.last_derivative);
}
