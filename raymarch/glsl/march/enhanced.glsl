// Enhanced sphere tracing (Bálint and Valasek 2018): the step to where the next sphere would touch this one, if the
// surface were the plane that the last two distances suggest, shortened by a factor. The first step is a plain one, for
// there is no slope yet. Where the ray recedes the plane is never met; the step then ends at the far end of the range.
// After a step that proved too long, the plain step taken in its place counts as the previous one.
// needs: field Ray Hit missed nearer settle u_side u_pixel epsilon contact max_steps relaxation
// gives: march
Hit march(Ray ray, float near, float far) {
    Hit hit = missed(near);
    float t = near;
    float r = u_side * field(ray.origin + t * ray.direction);
    hit.evaluations = 1.0;
    nearer(hit, t, r);
    float slope = -1.0;
    float z = r;
    bool plain = true;
    bool passing = false;  // near a surface, but not to meet it: from then on only contact counts
    for (int i = 0; i < max_steps; i++) {
        vec3 p = ray.origin + t * ray.direction;
        if (r < (passing ? contact(p, t) : epsilon(p, t))) {
            if (settle(hit, ray, t, r, i > 0 ? slope : 0.0)) return hit;
            passing = true;
        }
        if (t > far) return hit;
        hit.iterations += 1.0;
        hit.evaluations += 1.0;
        // With the slope m = (r - r_before) / d, (d - r_before + r) / (d + r_before - r) = (1 + m) / (1 - m).
        z = plain ? r : r + relaxation * r * (1.0 + slope) / max(1.0 - slope, 1.0e-6);
        z = max(r, min(z, far - t + r));
        float next = u_side * field(ray.origin + (t + z) * ray.direction);
        if (!plain && z > r + abs(next)) {
            plain = true;
            hit.fallbacks += 1.0;
            continue;
        }
        slope = clamp((next - r) / z, -1.0, 1.0);
        t += z;
        r = next;
        plain = false;
        nearer(hit, t, r);
    }
    hit.certified = 0.0;
    hit.found = hit.residual < u_pixel * hit.t;
    return hit;
}
