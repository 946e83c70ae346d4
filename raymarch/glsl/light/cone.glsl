// Soft shadow (Quilez 2008): the smallest ratio of the field to the radius of the light's disc at that distance. It is
// 0 where half of the light is visible.
float cone_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    float first;
    Ray ray = shadow_ray(surface, light, range, first);
    range = scene_cone(ray, range, width);
    width = min(width, 0.999);
    if (range.x >= range.y) return 1.0;
    return max(clearance(ray, range, first, 0.5 * contact(surface.p, surface.t), width, false), 0.0);
}
