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
// Most turns only search. What only a ray close to a surface needs stands in two branches, `close_step` and `confirm`.
#ifdef SKIPS
// Where branches are skipped, a turn that only searches skips both, with all that looks after kept spheres. The next
// step is chosen at the end of a turn, and held with the state.
#endif

#ifdef SKIPS
// The two marks of a ray in one number: for marks that a loop changes, compilers for GPUs keep masks of rays.
float mode_of(March at) {
    return (at.refining ? 1.0 : -1.0) * (at.passing ? 2.0 : 1.0);
}

#endif
// The part of a step near a surface that may stay unproven, and the width within which such steps begin.
float leap_width() {
#ifdef BOUNCES
    return leap_pixels * secondary_pixel();
#else
    return leap_pixels * u_pixel;
#endif
}

float close_width(vec3 widths) {
    float width = max(widths.y, 3.0 * leap_width());
#ifdef EDGES
    width = max(width, 0.5 * u_pixel);
#endif
    return width;
}

#ifdef CUTS
// Whether a ray starts on a face of the scene's box.
bool is_first(float r, float noise) {
#ifdef ADVANCE
    return r <= 0.0 && r >= -2.0 * noise;
#else
    return abs(r) <= noise;
#endif
}

#endif
// Whether the next turn of a ray may do more than search: its last sample lies within `width` of a surface, or the
// expected tangent point does.
bool is_close(March at, float width) {
#ifdef CUTS
    if (in_doubt(at)) return true;
#endif
    return at.refining || at.r + min(at.last_derivative, 0.0) * (at.r + width) < width;
}

float near_at(vec3 widths, March at, float t) {
    return width_at(widths, at.passing ? widths.z : widths.y, t);
}

bool is_aiming(vec3 widths, March at) {
    return at.refining || aims_at_surface(at.r, at.last_derivative, near_at(widths, at, at.t));
}

// The step of a ray close to a surface, in place of the step z of the tracer. `leap`: what may stay unproven of it.
float close_step(Ray ray, vec3 widths, March at, float z, inout float leap) {
    bool aiming = is_aiming(widths, at);
#ifdef ORTHOGRAPHIC
    float most = leap_width();
#else
    float most = leap_width() * at.t;
#endif
    float longest = (2.0 * at.r + 0.95 * most) / (1.0 - at.last_derivative);
    float further = further_step(at, z, most);
    if (aiming || further != 0.0) leap = max(leap, most);
#ifdef CUTS
    float depth = doubt_depth(ray, widths, at.t);
    bool first = is_first(at.r, noise_of(ray, at.t));
    if (first) leap = 1.0e30;
    float below = at.r + depth;
    float reach = longest_last_step(widths, at.t);
    float secant = at.last_derivative < 0.0 ? min(below / -at.last_derivative, depth + longest) : at.r;
    float search = max(z, 2.0 * GROWTH * at.t) + further;  // a flat field may be smaller than the ulp of t
    return in_doubt(at) ? doubt_step(at, depth, reach) : aiming ? secant : first ? depth : search;
#else
    float secant = at.last_derivative < 0.0 ? min(at.r / -at.last_derivative, longest) : at.r;
    return aiming ? secant : z + further;
#endif
}

// Takes the sample `next` at t, a step z from the ray's `last` sample, of which one is close to a surface. True if it
// ends the march. `at` has moved as in a search, with `empty` and `derivative`. That stays so if no sample is near.
// `behind`: how much of the ray before the sample is proven. `empty` stays false if the step was one of a search and is
// undone. `rate`: how much the field fell per unit of the way to the surface, at the last sample that knew it.
bool confirm(Ray ray, vec3 widths, March last, inout March at, float z, float t, float next, float behind,
    inout bool empty, float derivative, float rate) {
    bool between = last.refining && last.r < 0.0;  // the last sample is inside, so the surface lies before it
    bool certain = z <= last.r + behind;
#ifdef CUTS
    float noise = noise_of(ray, last.t);
    float depth = doubt_depth(ray, widths, last.t);
    bool doubtful = in_doubt(last);
    bool first = is_first(last.r, noise);
    certain = certain || first;
    bool known = z != 0.0 && !(first && next > 0.0);
#else
    bool known = z != 0.0;
#endif
    if (!known) {
        derivative = last.derivative;
        at.last_derivative = derivative;
#ifdef ADVANCE
        at.derivative = by_distance ? derivative : -1.0;
#else
        at.derivative = derivative;
#endif
    }
    empty = empty || between;
    if (between && next < 0.0) derivative = (next - last.kept_r) / (t - last.kept_t);
    bool near = empty && next < (last.refining ? abs(last.r) : near_at(widths, last, t));
    bool passed = last.refining && !near;
#ifdef NOTED
#ifdef CUTS
    note_kind(!doubtful && (!empty || passed) ? IS_UNDONE : last.refining || (near && !doubtful) ? REFINES : SEARCHES);
#else
    note_kind(!empty || passed ? IS_UNDONE : near ? REFINES : SEARCHES);
#endif
#endif
    bool found = false;
#ifdef CUTS
    bool aiming = is_aiming(widths, last) || first;
#ifdef ADVANCE
    float noise_there = noise_of(ray, t);  // a step may be long
    depth = doubt_depth(ray, widths, t);
    bool unproven = near ? next <= 2.0 * depth : empty && aiming && value_there <= 2.0 * depth;
    unproven = unproven && value_there >= -noise_there && last.r >= -2.0 * noise_there;
#else
    bool unproven = near && next >= -noise && last.r >= -noise && next <= 2.0 * depth;
#endif
    bool doubts = unproven && (aiming || derivative < 0.0);
    near = near && !unproven;
    if (doubtful || doubts) {
        at = last;
        empty = true;
        if (doubtful) {
#ifdef ADVANCE
            found = enters_ahead(at, t, noise);
        } else {
            doubt_ahead(at, t, derivative, rate, noise_there);
#else
            found = enters(at, t, next, noise);
        } else {
            doubt(at, t, next, derivative);
#endif
        }
    } else if (near || passed) {
#else
    bool touches = passed && abs(last.r) <= width_at(widths, hit_width(widths), last.t);
    if (touches) {
        at = last;
        found = true;
    } else if (near || passed) {
#endif
        // the last sample up to which all is certainly empty
        bool follows = certain && next >= 0.0 && (!last.refining || last.t == last.kept_t);
        vec2 kept = follows ? vec2(t, next) : last.refining ? vec2(last.kept_t, last.kept_r) : vec2(last.t, last.r);
        at.t = near ? t : kept.x;
        at.r = near ? next : kept.y;
        at.derivative = empty ? last.derivative : -1.0;
        at.last_derivative = near ? derivative : 0.0;
        at.kept_t = near ? kept.x : 0.0;
        at.kept_r = kept.y;
        at.passing = last.passing || passed;
        at.refining = near;
        empty = true;
#ifdef CUTS
        found = near && (refined(widths, t, next, derivative) || abs(next) <= 2.0 * depth);
#else
        found = near && refined(widths, t, next, derivative);
#endif
    }
    return found;
}

#ifdef CUTS
// What rounding of t may leave unproven of a step from there.
float least_leap(float t) {
    return 4.0 * GROWTH * t;
}

#endif
#ifdef SKIPS
// Whether a sample leaves a ray that only searches as one: neither it nor the expected tangent point is close to a
// surface. `wide`: twice the width within which it would be.
bool is_far(float next, float derivative, float wide) {
    return next + derivative * abs(next) >= wide;
}

#endif
// The next step of a ray.
// z : its length. leap : what may stay unproven of it; negative if a ray only searches. end : 0 if the ray goes on,
// 1 if it has met a surface, 2 if it has left its range.
#ifdef SKIPS
// reach : how far it may search on without another look at its state.
#endif
struct Way {
    float z;
    float leap;
    float end;
#ifdef SKIPS
    float reach;
#endif
};

// width : within which the last sample of a ray is close to a surface.
Way next_way(Ray ray, vec3 widths, float width, March at, float far) {
#ifdef SKIPS
    bool plain = at.kept_t == 0.0 && at.r >= 0.0;  // from inside of an estimate a ray steps back
    Way way = Way(step_length(at, far), -1.0, 0.0, plain ? far : -1.0);
#else
    Way way = Way(step_length(at, far), -1.0, 0.0);
#endif
    if (is_close(at, width) || at.t + at.r > far) {
#ifdef CUTS
        way.leap = least_leap(at.t);
#else
        way.leap = 0.0;
#endif
        way.z = close_step(ray, widths, at, way.z, way.leap);
#ifdef SKIPS
        way.reach = -1.0;
#endif
        if (!at.refining && at.t + min(way.z, at.r) > far) way.end = 2.0;
#ifdef EDGES
        if (edge_width > 0.0 && is_expected(at)) way.end = 1.0;
#endif
    }
    return way;
}

void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec3 widths = hit_widths(ray);
    float near_width = close_width(widths);
#ifdef SKIPS
    vec3 wider = 2.0 * widths;
    float wider_near = 2.0 * near_width;
    float mode = mode_of(at);
#endif
#ifdef NOTED
    note_sample(at.t, at.r, at.r, STARTS);
#endif
    float steps = 0.0;
#ifdef SKIPS
    Way way = next_way(ray, widths, 1.0e30, at, far);
    if (way.end == 0.0) {
#else
    Way way;
    float width = 1.0e30;
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
#ifndef SKIPS
        way = next_way(ray, widths, width, at, far);
        if (way.end != 0.0) break;
#endif
        float z = way.z;
        float t = at.t + z;
#ifdef ADVANCE
        float rate = approach;
#else
        float rate = 1.0;
#endif
        float next = march_distance(ray, t);
#ifdef ADVANCE
        float behind = way_behind;  // proven before the sample, by the sphere or more
#else
        float behind = abs(next);
#endif
        steps += 1.0;
        float derivative = (next - at.r) / z;
#ifdef SKIPS
#ifdef CUTS
        float proven = at.r + behind + least_leap(at.t);
#else
        float proven = at.r + behind;
#endif
#endif
        March last = at;
#ifdef SKIPS
        follow(at, t, next, derivative);
        way.z = free_step(at);
        bool far_off = is_far(next, derivative, width_at(wider, wider_near, t));
        if (far_off && t + way.z <= way.reach && z <= proven) continue;
        last.refining = mode > 0.0;
        last.passing = abs(mode) > 1.5;
        at = last;
        float width = width_at(widths, near_width, t);
#else
        width = width_at(widths, near_width, t);
#endif
        // else the step may have passed a surface
#ifdef SKIPS
        bool empty = z <= max(proven, last.r + behind + way.leap);
#else
#ifdef CUTS
        bool empty = z <= last.r + behind + max(way.leap, least_leap(last.t));
#else
        bool empty = z <= last.r + behind + max(way.leap, 0.0);
#endif
#endif
#ifdef NOTED
#ifdef ADVANCE
        note_sample(t, next, next < 0.0 ? next : way_behind, empty ? SEARCHES : IS_UNDONE);
#else
        note_sample(t, next, next, empty ? SEARCHES : IS_UNDONE);
#endif
#endif
        move(at, empty, t, next, derivative);
        if (way.leap >= 0.0 || next < width) {
            if (confirm(ray, widths, last, at, z, t, next, behind, empty, derivative, rate)) {
                way.end = 1.0;
                break;
            }
        }
        hit.fallbacks += float(!empty);
#ifdef SKIPS
        mode = mode_of(at);
        way = next_way(ray, widths, width, at, far);
        if (way.end != 0.0) break;
    }
#endif
    }
    bool found = way.end == 1.0;
    bool escaped = way.end == 2.0;
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
    if (found) hit.t += way_below_level(ray, at.t, width_at(widths, widths.y, at.t));
#endif
    hit.residual = abs(at.r);
    hit.iterations += steps;
    hit.evaluations += steps;
    if (!hit.done) on_exhausted(hit, at.last_derivative);
}
