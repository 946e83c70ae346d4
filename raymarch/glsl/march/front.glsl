// The certified front: everything up to `front` is known to be free. The next sample is asked beyond it, where the
// averaged slope expects its sphere to touch the front. If it does not reach back, the sphere is kept: it is free too,
// only the gap before it is not known yet. The gap is halved until it closes, and then the front jumps to the kept
// sphere's far end, so that a step that was too long is not wasted. A kept sphere inside the solid holds no surface
// either, and ends the gap for good: the first surface lies before it.
// needs: field Ray Hit missed nearer settle u_side u_pixel epsilon contact max_steps smoothing
// gives: march
Hit march(Ray ray, float near, float far) {
    Hit hit = missed(near);
    float t = near;
    float r = u_side * field(ray.origin + t * ray.direction);
    hit.evaluations = 1.0;
    nearer(hit, t, r);
    float front = t + r;
    float mean = -1.0;
    float slope = 0.0;
    bool kept = false;  // whether a sphere beyond the gap is kept: its centre and radius
    float kept_t = 0.0;
    float kept_r = 0.0;
    bool passing = false;  // near a surface, but not to meet it: from then on only contact counts
    for (int i = 0; i < max_steps; i++) {
        vec3 p = ray.origin + t * ray.direction;
        if (r < (passing ? contact(p, t) : epsilon(p, t))) {
            if (settle(hit, ray, t, r, slope)) return hit;
            passing = true;
        }
        if (front > far) return hit;
        hit.iterations += 1.0;
        hit.evaluations += 1.0;
        float c = min(t + 2.0 * r / (1.0 - mean), far + r);
        float low = kept_t - abs(kept_r);
        if (kept && c >= low) c = 0.5 * (front + low);
        c = max(c, front);
        float next = u_side * field(ray.origin + c * ray.direction);
        if (c - next > front && c > front) {
            hit.fallbacks += 1.0;
            kept = true;
            kept_t = c;
            kept_r = next;
            continue;
        }
        slope = (next - r) / (c - t);
        mean = clamp(mix(mean, slope, smoothing), -1.0, 0.999);
        t = c;
        r = next;
        front = max(front, c + next);
        nearer(hit, t, r);
        if (kept && kept_r > 0.0 && front >= kept_t - kept_r && kept_t > t) {
            slope = (kept_r - r) / (kept_t - t);
            t = kept_t;
            r = kept_r;
            front = max(front, t + r);
            nearer(hit, t, r);
        }
        if (kept && t >= kept_t - abs(kept_r)) kept = false;
    }
    hit.certified = 0.0;
    hit.found = hit.residual < u_pixel * hit.t;
    return hit;
}
