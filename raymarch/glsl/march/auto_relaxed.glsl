// Auto-relaxed sphere tracing (Bán and Valasek 2023): as the enhanced tracer, but with a slope averaged over the
// steps, and no factor to choose: the step is the whole way to where the spheres would touch. A step that proved too
// long forgets the slope and is taken again as a plain one.
// needs: field Ray Hit missed nearer settle u_side u_pixel epsilon contact max_steps smoothing
// gives: march
Hit march(Ray ray, float near, float far) {
    Hit hit = missed(near);
    float t = near;
    float r = u_side * field(ray.origin + t * ray.direction);
    hit.evaluations = 1.0;
    nearer(hit, t, r);
    float mean = -1.0;  // slope, averaged
    float slope = 0.0;  // slope of the last step alone
    bool passing = false;  // near a surface, but not to meet it: from then on only contact counts
    for (int i = 0; i < max_steps; i++) {
        vec3 p = ray.origin + t * ray.direction;
        if (r < (passing ? contact(p, t) : epsilon(p, t))) {
            if (settle(hit, ray, t, r, slope)) return hit;
            passing = true;
        }
        if (t > far) return hit;
        hit.iterations += 1.0;
        hit.evaluations += 1.0;
        float z = max(r, min(2.0 * r / (1.0 - mean), far - t + r));
        float next = u_side * field(ray.origin + (t + z) * ray.direction);
        if (z > r + abs(next) && mean > -1.0) {
            mean = -1.0;
            hit.fallbacks += 1.0;
            continue;
        }
        slope = (next - r) / z;
        mean = clamp(mix(mean, slope, smoothing), -1.0, 0.999);
        t += z;
        r = next;
        nearer(hit, t, r);
    }
    hit.certified = 0.0;
    hit.found = hit.residual < u_pixel * hit.t;
    return hit;
}
