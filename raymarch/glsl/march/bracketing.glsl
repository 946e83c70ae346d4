// Bracketing sphere tracing: the ray is certified empty up to `front`. The next sample lies beyond, where the averaged
// derivative predicts that its sphere touches the front. If its sphere does not reach back to the front, the sphere is
// kept: it is empty too, but the gap before it is unknown. The gap is bisected until it closes. Then the front advances
// to the far end of the kept sphere, so that a step that was too long is not wasted. A kept sphere inside the solid
// contains no surface either and bounds the gap: the first surface lies before it.
// needs: march_distance Ray Hit March keep_closest refine_hit on_exhausted epsilon contact march_steps smoothing
// gives: march
void march(Ray ray, inout March at, inout Hit hit, float far) {
    hit.done = true;
    hit.found = false;
    if (!at.asked) {
        at.r = march_distance(ray, at.t);
        at.asked = true;
        hit.evaluations += 1.0;
        hit.t = at.t;
        hit.residual = abs(at.r);
        at.front = vec3(at.t + at.r, 0.0, 0.0);
    }
    float front = at.front.x;
    float kept_t = at.front.y;  // the kept sphere beyond the gap: centre and radius; centre 0 for none
    float kept_r = at.front.z;
    for (int i = 0; i < march_steps;) {
        // all rays march until they are near a surface, and only then refine, all together
        bool near = false;
        for (; i < march_steps; i++) {
            vec3 p = ray.origin + at.t * ray.direction;
            if (at.r < (at.passing ? contact(p, at.t) : epsilon(p, at.t)) && !at.must_step) {
                near = true;
                break;
            }
            if (front > far) return;
            at.must_step = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float c = min(at.t + 2.0 * at.r / (1.0 - at.derivative), far + at.r);
            bool kept = kept_t > 0.0;
            float low = kept_t - abs(kept_r);
            if (kept && c >= low) c = 0.5 * (front + low);
            c = max(c, front);
            bool gap = c > front && !(kept && c >= low);  // false if no float32 lies between front and kept sphere
            float next = march_distance(ray, c);
            if (gap && c - next > front) {
                hit.fallbacks += 1.0;
                kept_t = c;
                kept_r = next;
                at.derivative = (next - at.r) / (c - at.t);  // up to the kept sphere
                continue;
            }
            at.last_derivative = (next - at.r) / (c - at.t);
            at.derivative = clamp(mix(at.derivative, at.last_derivative, smoothing), -1.0, 0.999);
            at.t = c;
            at.r = next;
            front = max(front, c + next);
            keep_closest(hit, at.t, at.r);
            if (kept && kept_r > 0.0 && front >= kept_t - kept_r && kept_t > at.t) {
                at.last_derivative = (kept_r - at.r) / (kept_t - at.t);
                at.t = kept_t;
                at.r = kept_r;
                front = max(front, at.t + at.r);
                keep_closest(hit, at.t, at.r);
            }
            if (kept && at.t >= kept_t - kept_r) kept_t = 0.0;
        }
        if (!near) break;
        if (refine_hit(hit, ray, at.t, at.r, at.last_derivative)) return;
        at.passing = true;
        at.must_step = true;
    }
    at.front = vec3(front, kept_t, kept_r);
    on_exhausted(hit);
}
