// Plain sphere tracing (Hart 1996): each step is the distance itself, so no surface is stepped over.
// needs: along Ray Hit March missed nearer settle exhausted epsilon contact march_steps step_scale
// gives: march
Hit march(Ray ray, inout March at, float far) {
    Hit hit = missed(at.t);
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations = 1.0;
    }
    nearer(hit, at.t, at.r);
    float slope = 0.0;
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
            if (at.t + step_scale * at.r > far) return hit;
            leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float z = step_scale * at.r;
            float next = along(ray, at.t + z);
            slope = (next - at.r) / z;
            at = March(at.t + z, next, slope, true, at.passing);
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
