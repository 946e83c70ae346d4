// Auto-relaxed sphere tracing (Bán and Valasek 2023): as the enhanced tracer, but with a slope averaged over the
// steps, and no factor to choose: the step is the whole way to where the spheres would touch. A step that proved too
// long forgets the slope and is taken again as a plain one.
// needs: along Ray Hit March missed nearer settle aims exhausted epsilon contact march_steps smoothing
// gives: march
Hit march(Ray ray, inout March at, float far) {
    Hit hit = missed(at.t);
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations = 1.0;
    }
    nearer(hit, at.t, at.r);
    float slope = at.slope;  // of the last step alone
    bool leaving = false;  // its last steps met nothing: it takes one step before it looks again
    for (int i = 0; i < march_steps; i++) {
        // all rays march on until they are near a surface, and only then take their last steps, all together
        bool near = false;
        vec2 to = vec2(-1.0);  // a sample that aimed at the surface, with the field there
        for (; i < march_steps; i++) {
            vec3 p = ray.origin + at.t * ray.direction;
            float reach = at.passing ? contact(p, at.t) : epsilon(p, at.t);
            if (at.r < reach && !leaving) {
                near = true;
                break;
            }
            if (at.t + at.r > far) return hit;
            leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float z = max(at.r, min(2.0 * at.r / (1.0 - at.slope), far - at.t + at.r));
            bool aiming = aims(at.r, slope, reach);
            if (aiming) z = at.r / -slope;
            float next = along(ray, at.t + z);
            if (aiming && abs(next) < reach) {
                near = true;
                to = vec2(at.t + z, next);
                slope = (next - at.r) / z;
                break;
            }
            if (z > at.r + abs(next)) {
                slope = at.slope = -1.0;
                hit.fallbacks += 1.0;
                continue;
            }
            slope = (next - at.r) / z;
            at = March(at.t + z, next, clamp(mix(at.slope, slope, smoothing), -1.0, 0.999), true, at.passing);
            nearer(hit, at.t, at.r);
        }
        if (!near) break;
        if (to.x < 0.0) to = vec2(at.t, at.r);
        if (settle(hit, ray, to.x, to.y, slope)) return hit;
        at.passing = true;
        leaving = true;
    }
    exhausted(hit);
    return hit;
}
