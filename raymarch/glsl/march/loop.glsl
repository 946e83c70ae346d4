// The march of a ray: steps of the tracer's length until one ends near a surface. A step longer than the sum of the
// spheres' radii at its ends may have passed a surface. It is undone, and the derivative `UNDONE` reports this to the
// tracer. `at` and `hit` hold the whole state, so that a march split over passes evaluates the field at the same
// points.
// needs: march_distance Ray Hit March keep_closest refine_hit aims_at_surface on_exhausted epsilon contact march_steps step_length averaged_derivative UNDONE
// gives: march
void march(Ray ray, inout March at, inout Hit hit, float far) {
    hit.done = true;
    hit.found = false;
    if (!at.asked) {
        at.r = march_distance(ray, at.t);
        at.asked = true;
        hit.evaluations += 1.0;
        hit.t = at.t;
        hit.residual = abs(at.r);
    }
    for (int i = 0; i < march_steps;) {
        // all rays march until they are near a surface, and only then refine, all together
        bool near = false;
        vec2 to = vec2(-1.0);  // a sample aimed at the surface: its distance and the field there
        for (; i < march_steps; i++) {
            vec3 p = ray.origin + at.t * ray.direction;
            float reach = at.passing ? contact(p, at.t) : epsilon(p, at.t);
            if (at.r < reach && !at.must_step) {
                near = true;
                break;
            }
            bool aiming = aims_at_surface(at.r, at.last_derivative, reach);
            float z = aiming ? at.r / -at.last_derivative : step_length(at, far);
            if (at.t + min(z, at.r) > far) return;
            at.must_step = false;
            hit.iterations += 1.0;
            hit.evaluations += 1.0;
            float next = march_distance(ray, at.t + z);
            if (aiming && next < reach) {  // in front of the surface or behind it
                near = true;
                to = vec2(at.t + z, next);
                at.last_derivative = (next - at.r) / z;
                i++;
                break;
            }
            if (z > at.r + abs(next)) {
                at.last_derivative = at.derivative = UNDONE;
                hit.fallbacks += 1.0;
                continue;
            }
            at.last_derivative = (next - at.r) / z;
            at.derivative = averaged_derivative(at.derivative, at.last_derivative);
            at.t += z;
            at.r = next;
            keep_closest(hit, at.t, at.r);
        }
        if (!near) break;
        if (to.x < 0.0) to = vec2(at.t, at.r);
        if (refine_hit(hit, ray, to.x, to.y, at.last_derivative)) return;
        at.passing = true;
        at.must_step = true;
    }
    on_exhausted(hit);
}
