// The certified front: everything up to `front` is known to be free. The next sample is asked beyond it, where the
// averaged slope expects its sphere to touch the front. If it does not reach back, the sphere is kept: it is free too,
// only the gap before it is not known yet. The gap is halved until it closes, and then the front jumps to the kept
// sphere's far end, so that a step that was too long is not wasted. A kept sphere inside the solid holds no surface
// either, and ends the gap for good: the first surface lies before it.
// needs: along Ray Hit March missed nearer settle exhausted epsilon contact march_steps smoothing
// gives: march
Hit march(Ray ray, inout March at, float far) {
    Hit hit = missed(at.t);
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations = 1.0;
    }
    nearer(hit, at.t, at.r);
    float front = at.t + at.r;
    float slope = at.slope;  // of the last step alone
    bool kept = false;  // whether a sphere beyond the gap is kept: its centre and radius
    float kept_t = 0.0;
    float kept_r = 0.0;
    bool leaving = false;  // its last steps met nothing: it takes one step before it looks again
    for (int i = 0; i < march_steps; i++) {
        // all rays march on until they are near a surface, and only then take their last steps, all together
        bool near = false;
        for (; i < march_steps; i++) {
            vec3 p = ray.origin + at.t * ray.direction;
            if (at.r < (at.passing ? contact(p, at.t) : epsilon(p, at.t)) && !leaving) {
                near = true;
                break;
            }
            if (front > far) return hit;
            leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float c = min(at.t + 2.0 * at.r / (1.0 - at.slope), far + at.r);
            float low = kept_t - abs(kept_r);
            if (kept && c >= low) c = 0.5 * (front + low);
            c = max(c, front);
            bool gap = c > front && !(kept && c >= low);  // no number lies between a front and a sphere that nearly touch
            float next = along(ray, c);
            if (gap && c - next > front) {
                hit.fallbacks += 1.0;
                kept = true;
                kept_t = c;
                kept_r = next;
                at.slope = (next - at.r) / (c - at.t);  // up to the kept sphere
                continue;
            }
            slope = (next - at.r) / (c - at.t);
            at = March(c, next, clamp(mix(at.slope, slope, smoothing), -1.0, 0.999), true, at.passing);
            front = max(front, c + next);
            nearer(hit, at.t, at.r);
            if (kept && kept_r > 0.0 && front >= kept_t - kept_r && kept_t > at.t) {
                slope = (kept_r - at.r) / (kept_t - at.t);
                at.t = kept_t;
                at.r = kept_r;
                front = max(front, at.t + at.r);
                nearer(hit, at.t, at.r);
            }
            if (kept && at.t >= kept_t - kept_r) kept = false;
        }
        if (!near) break;
        if (settle(hit, ray, at.t, at.r, slope)) return hit;
        at.passing = true;
        leaving = true;
    }
    exhausted(hit);
    return hit;
}
