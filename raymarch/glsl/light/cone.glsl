// Soft shadow by the smallest clearance over the radius of the light's disc at that distance (Quilez 2008): dark at the
// edge where half of the light is seen, but for one evaluation a step.
// needs: field Ray Surface Light leaving unbent contact shadow_steps scene_cone u_side
// gives: cone_shadow
float cone_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = leaving(surface.p, unbent(surface), light.direction, surface.t, start);
    vec2 range = scene_cone(ray, vec2(start, light.distance), width);
    float least = 1.0;
    float s = range.x;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) break;
        float r = u_side * field(ray.origin + s * ray.direction);
        least = min(least, r / (width * s));
        if (r <= 0.5 * contact(surface.p, surface.t)) return 0.0;
        s += r;
    }
    return least;
}
