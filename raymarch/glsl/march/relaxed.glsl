// Over-relaxed sphere tracing (Keinert et al. 2014): steps are longer than the distance by a fixed factor. A step whose
// spheres do not touch may have passed a surface; it is undone and a plain step taken in its place. After that the
// ray goes on with plain steps (Keinert), or relaxes again (Bálint and Valasek 2018), as `relax_again` says.
// needs: along Ray Hit March missed nearer settle exhausted epsilon contact march_steps relaxation relax_again
// gives: march UNDONE
const float UNDONE = 2.0;  // in place of a slope: the last step was too long

Hit march(Ray ray, inout March at, float far) {
    Hit hit = missed(at.t);
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations = 1.0;
    }
    nearer(hit, at.t, at.r);
    float slope = 0.0;
    float omega = at.slope >= UNDONE ? 1.0 : relaxation;
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
            if (at.t + at.r > far) return hit;
            leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float z = omega * at.r;
            float next = along(ray, at.t + z);
            if (omega > 1.0 && z > at.r + abs(next)) {
                omega = 1.0;
                at.slope = UNDONE;
                hit.fallbacks += 1.0;
                continue;
            }
            slope = (next - at.r) / z;
            if (relax_again) omega = relaxation;
            at = March(at.t + z, next, omega > 1.0 ? slope : UNDONE, true, at.passing);
            nearer(hit, at.t, at.r);
        }
        if (!near) break;
        if (settle(hit, ray, at.t, at.r, slope)) return hit;
        at.passing = true;
        leaving = true;
    }
    exhausted(hit);
    return hit;
}
