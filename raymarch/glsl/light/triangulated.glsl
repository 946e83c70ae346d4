// Soft shadow as by a cone, with the clearance where the ray passes nearest between two samples (Aaltonen 2018): the
// spheres of two steps meet in a circle, and the obstacle is taken to be on it. The first step knows no other.
// needs: field Ray Surface Light leaving unbent contact shadow_steps scene_cone u_side
// gives: triangulated_shadow
float triangulated_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = leaving(surface.p, unbent(surface), light.direction, surface.t, start);
    vec2 range = scene_cone(ray, vec2(start, light.distance), width);
    float least = 1.0;
    float last = 0.0;
    float s = range.x;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) break;
        float r = u_side * field(ray.origin + s * ray.direction);
        if (r <= 0.5 * contact(surface.p, surface.t)) return 0.0;
        // Where it would be farther back than the last sample, the obstacle is not between the two, but behind both.
        float back = r * r < 2.0 * last * last ? r * r / (2.0 * last) : 0.0;
        least = min(least, sqrt(r * r - back * back) / (width * (s - back)));
        last = r;
        s += r;
    }
    return least;
}
