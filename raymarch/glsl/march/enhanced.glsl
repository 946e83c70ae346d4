// Enhanced sphere tracing (Bálint and Valasek 2018): the step to where the next sphere would touch this one, if the
// surface were the plane that the last two distances suggest, shortened by a factor. The first step is a plain one, for
// there is no slope yet. Where the ray recedes the plane is never met; the step then ends at the far end of the range.
// After a step that proved too long, the plain step taken in its place counts as the previous one.
// needs: along Ray Hit March missed nearer settle exhausted epsilon contact march_steps relaxation
// gives: march
Hit march(Ray ray, inout March at, float far) {
    Hit hit = missed(at.t);
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations = 1.0;
    }
    nearer(hit, at.t, at.r);
    bool plain = at.slope <= -1.0;
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
            // With the slope m = (r - r_before) / d, (d - r_before + r) / (d + r_before - r) = (1 + m) / (1 - m).
            float z = plain ? at.r : at.r + relaxation * at.r * (1.0 + at.slope) / max(1.0 - at.slope, 1.0e-6);
            z = max(at.r, min(z, far - at.t + at.r));
            float next = along(ray, at.t + z);
            if (!plain && z > at.r + abs(next)) {
                plain = true;
                at.slope = -1.0;
                hit.fallbacks += 1.0;
                continue;
            }
            at = March(at.t + z, next, clamp((next - at.r) / z, -1.0, 1.0), true, at.passing);
            plain = false;
            nearer(hit, at.t, at.r);
        }
        if (!near) break;
        if (settle(hit, ray, at.t, at.r, at.slope)) return hit;
        at.passing = true;
        leaving = true;
    }
    exhausted(hit);
    return hit;
}
