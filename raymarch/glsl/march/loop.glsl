// The march of a ray: steps as long as the tracer says, until one ends near a surface. A step that is longer than the
// spheres around both of its ends may have passed a surface: it is undone, and the tracer told by a slope of `UNDONE`.
// `at` and `hit` hold all that a march needs to go on, so that one in pieces asks the field at the same points.
// needs: along Ray Hit March nearer settle aims exhausted epsilon contact march_steps stride remembered UNDONE
// gives: march
void march(Ray ray, inout March at, inout Hit hit, float far) {
    hit.done = true;
    hit.found = false;
    if (!at.asked) {
        at.r = along(ray, at.t);
        at.asked = true;
        hit.evaluations += 1.0;
        hit.t = at.t;
        hit.residual = abs(at.r);
    }
    for (int i = 0; i < march_steps;) {
        // all rays march on until they are near a surface, and only then take their last steps, all together
        bool near = false;
        vec2 to = vec2(-1.0);  // a sample that aimed at the surface, with the field there
        for (; i < march_steps; i++) {
            vec3 p = ray.origin + at.t * ray.direction;
            float reach = at.passing ? contact(p, at.t) : epsilon(p, at.t);
            if (at.r < reach && !at.leaving) {
                near = true;
                break;
            }
            bool aiming = aims(at.r, at.last, reach);
            float z = aiming ? at.r / -at.last : stride(at, far);
            if (at.t + min(z, at.r) > far) return;
            at.leaving = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float next = along(ray, at.t + z);
            if (aiming && next < reach) {  // in front of it, or behind it: then it lies between
                near = true;
                to = vec2(at.t + z, next);
                at.last = (next - at.r) / z;
                i++;
                break;
            }
            if (z > at.r + abs(next)) {
                at.last = at.slope = UNDONE;
                hit.fallbacks += 1.0;
                continue;
            }
            at.last = (next - at.r) / z;
            at.slope = remembered(at.slope, at.last);
            at.t += z;
            at.r = next;
            nearer(hit, at.t, at.r);
        }
        if (!near) break;
        if (to.x < 0.0) to = vec2(at.t, at.r);
        if (settle(hit, ray, to.x, to.y, at.last)) return;
        at.passing = true;
        at.leaving = true;
    }
    exhausted(hit);
}
