// What a ray meets that leaves a surface: plain steps from where it starts, inside of the solid if `side` is -1. `travelled`
// is the way of the light before it, by which its precision is measured.
// needs: field Ray Hit missed contact max_steps scene_box u_side u_far
// gives: second
Hit second(Ray ray, float start, float travelled, float side) {
    Hit hit = missed(0.0);
    vec2 range = scene_box(ray, vec2(start, 2.0 * u_far));
    float t = side < 0.0 ? min(range.x, range.y) : range.x;  // thin glass may end before where it starts
    for (int i = 0; i < max_steps; i++) {
        if (t > range.y) return hit;
        vec3 p = ray.origin + t * ray.direction;
        float r = side * u_side * field(p);
        hit.evaluations += 1.0;
        if (r < contact(p, travelled + t)) {
            hit.found = true;
            hit.t = t + r;
            hit.residual = max(r, 0.0);  // at most
            return hit;
        }
        t += r;
    }
    return hit;
}
