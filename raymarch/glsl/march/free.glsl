// Steps as long as the ray is free, where every solid tells how far that is: none passes a surface, so none is undone
// or refined. A ray has hit a surface where it is free for no more than a hit's width.
const float UNDONE = -1.0;

float step_length(March at, float far) {
    return at.r;
}

void move(inout March at, bool empty, float t, float r, float derivative) {
    at.t = t;
    at.r = r;
    at.derivative = UNDONE;
}

// The march of a ray. `at` and `hit` hold the whole state.
void march(Ray ray, inout March at, inout Hit hit, float far) {
    vec3 widths = hit_widths(ray);
#ifdef NOTED
    note_sample(at.t, at.r, at.r, STARTS);
#endif
    bool found = false;
    bool escaped = false;
    float steps = 0.0;
    for (int i = 0; i < march_steps; i++) {
        float t = at.t + at.r;
        escaped = t > far;
        if (escaped) break;
        steps += 1.0;
        at.t = t;
        at.r = march_distance(ray, t);
#ifdef NOTED
        note_sample(t, at.r, at.r < 0.0 ? at.r : way_behind, SEARCHES);
#endif
        found = at.r <= width_at(widths, widths.z, t);
        if (found) break;
    }
    at.derivative = UNDONE;
    hit.done = found || escaped;
    hit.found = found;
    hit.residual = abs(at.r);
    hit.t = at.t;
    if (found) hit.t += max(at.r, 0.0) + way_below_level(ray, at.t, width_at(widths, widths.y, at.t));
#ifdef CLIP_PLANES
    if (found && hit.t > between_planes(ray, u_far).y) hit.found = false;
#endif
#ifdef ANALYTIC
    if (found && hit.t > solved_t) hit.found = false;
#endif
    hit.iterations += steps;
    hit.evaluations += steps;
    if (!hit.done) on_exhausted(hit, at.derivative);
}
