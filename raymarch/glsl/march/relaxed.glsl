// Over-relaxed sphere tracing (Keinert et al. 2014): steps are longer than the distance by a fixed factor. A step whose
// spheres do not touch may have passed a surface; it is undone and a plain step taken in its place. After that the
// ray goes on with plain steps (Keinert), or relaxes again (Bálint and Valasek 2018), as `relax_again` says.
// needs: field Ray Hit missed nearer settle u_side u_pixel epsilon contact max_steps relaxation relax_again
// gives: march
Hit march(Ray ray, float near, float far) {
    Hit hit = missed(near);
    float t = near;  // last sample that is certified
    float r = u_side * field(ray.origin + t * ray.direction);
    hit.evaluations = 1.0;
    nearer(hit, t, r);
    float slope = 0.0;
    float omega = relaxation;
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
        float z = omega * r;
        float next = u_side * field(ray.origin + (t + z) * ray.direction);
        if (omega > 1.0 && z > r + abs(next)) {
            omega = 1.0;
            hit.fallbacks += 1.0;
            continue;
        }
        slope = (next - r) / z;
        t += z;
        r = next;
        if (relax_again) omega = relaxation;
        nearer(hit, t, r);
    }
    hit.certified = 0.0;
    hit.found = hit.residual < u_pixel * hit.t;
    return hit;
}
