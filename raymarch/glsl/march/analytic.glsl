// Rays are marched where there are solids to march, up to the nearest hit in closed form. A ray that starts inside a
// solid is marched through all of them.
float solved_t;  // of the nearest hit in closed form of the pixel's ray; 1e30 for none

vec2 range_of(Ray ray) {
    vec2 range = scene_range(ray);
    solved_t = 1.0e30;
#ifdef OWN_START
    if (range.x > range.y) return range;
    vec3 widths = hit_widths(ray);
    float width = width_at(widths, hit_width(widths), range.x);
    // a ray may start on a surface, see march/enter
    u_side = ray_field(ray.origin + range.x * ray.direction, true) < -width ? -1.0 : 1.0;
#endif
    if (u_side < 0.0) return range;
#ifndef CONE
    solved_t = solved_hit(ray.origin, ray.direction, range.x, range.x);
    if (solved_t > range.y) solved_t = 1.0e30;
#endif
    range = marched_range(ray, range);
    return vec2(range.x, min(range.y, solved_t));
}

// A ray that has no marched hit hits the nearest solid in closed form.
void keep_solved(inout Hit hit) {
    if (hit.found || solved_t >= 1.0e30) return;
    hit.found = true;
    hit.t = solved_t;
    hit.residual = 0.0;
}
