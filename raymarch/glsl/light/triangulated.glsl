// Soft shadow (Aaltonen 2018): as light/cone, with the point of closest approach between two samples: the spheres of
// two steps intersect in a circle, on which the occluder is assumed to lie.
float triangulated_shadow(Surface surface, Light light, float width) {
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
        // If the circle lies before the last sample, the occluder is not between the two samples, but beyond both.
#ifdef UNDIVIDED
        float back = before > 0.0 ? 0.5 * (before + (r - last) * (r + last) / before) : 0.0;
        back = back > 0.0 && back < min(before, r) ? back : 0.0;
#else
        float back = r * r < 2.0 * last * last ? r * r / (2.0 * last) : 0.0;
#endif
        least = min(least, sqrt(r * r - back * back) / (width * (s - back)));
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
