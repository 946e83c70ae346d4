// The march of a ray: steps as long as the tracer says, until one ends near a surface. A step that is longer than the
// spheres around both of its ends may have passed a surface: it is undone, and the tracer told by a slope of `UNDONE`.
// needs: along Ray Hit March missed nearer settle aims exhausted epsilon contact march_steps stride remembered UNDONE
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
            bool aiming = aims(at.r, slope, reach);
            float z = aiming ? at.r / -slope : stride(at, far);
            if (at.t + min(z, at.r) > far) return hit;
            leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float next = along(ray, at.t + z);
            if (aiming && next < reach) {  // in front of it, or behind it: then it lies between
                near = true;
                to = vec2(at.t + z, next);
                slope = (next - at.r) / z;
                break;
            }
            if (z > at.r + abs(next)) {
                slope = at.slope = UNDONE;
                hit.fallbacks += 1.0;
                continue;
            }
            slope = (next - at.r) / z;
            at = March(at.t + z, next, remembered(at.slope, slope), true, at.passing);
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
