// Soft shadow (Quilez 2008): the smallest ratio of the field to the radius of the light's disc at that distance. It
// costs one evaluation per step, but is 0 where half of the light is visible.
float cone_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    Ray ray = shadow_ray(surface, light, range);
    range = scene_cone(ray, range, width);
    float near = 0.5 * contact(surface.p, surface.t);
    float least = 1.0;
    float s = range.x;
    float z = 0.0;
    float before = 0.0;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) return least;
        last = r;
#ifdef UNDIVIDED
        r = u_side * undivided_field(ray.origin + s * ray.direction);
#else
        r = u_side * field(ray.origin + s * ray.direction);
#endif
        if (r <= near + GROWTH * s) return 0.0;
        least = min(least, r / (width * s));
        before = z;
#ifdef UNDIVIDED
        z = safe_step(divided(r), s);
#else
        z = safe_step(r, s);
#endif
        s += z;
    }
    float derivative = (r - last) / before;
    return meets_ahead(r, derivative, range.y - s + z) ? 0.0 : least;
}
