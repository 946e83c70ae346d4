// What a ray meets that starts at a surface: plain steps, inside of the solid if `side` is -1. `travelled` is the way of the
// light before it, by which its precision is measured.
// needs: field Ray Hit missed epsilon max_steps scene_box u_side u_far
// gives: second
Hit second(Ray ray, float travelled, float side) {
    Hit hit = missed(0.0);
    vec2 range = scene_box(ray, vec2(0.0, 2.0 * u_far));
    float t = range.x;
    for (int i = 0; i < max_steps; i++) {
        if (t > range.y) return hit;
        vec3 p = ray.origin + t * ray.direction;
        float r = side * u_side * field(p);
        hit.evaluations += 1.0;
        if (r < epsilon(p, travelled + t)) {
            hit.found = true;
            hit.t = t;
            return hit;
        }
        t += r;
    }
    return hit;
}
