// Soft shadow: the visible fraction of the light's disc. `width` is the sine of the light's angular radius. The
// field r relative to the radius of the disc at that distance runs from -1 (fully occluded) to 1 (visible). An occluder
// with a straight edge then leaves the fraction 1/2 + (r sqrt(1 - r^2) + asin r) / pi of the disc visible.
// The ray continues inside occluders, where the depth stands for the distance to the edge. The depth is never larger
// than that distance, so occluders thinner than the disc let light through, unlike in light/cone.
// Steps skip regions that cannot lower the minimum and are half the distance elsewhere, so that the minimum between two
// samples is known to a relative error of 1/30. The disc is at least 64 ulp of the coordinates wide, because the field
// is exact to a few ulp only. A ray that runs out of steps is extrapolated linearly from its last two samples.
float two_sided_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    Ray ray = shadow_ray(surface, light, range);
    range = scene_cone(ray, range, width);
    width = max(width, 64.0 * GROWTH);
    float least = 1.0;
    float s = range.x;
    float z = 0.0;
    float before = 0.0;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < shadow_steps && s < range.y; i++) {
        last = r;
#ifdef UNDIVIDED
        r = u_side * undivided_field(ray.origin + s * ray.direction);
#else
        r = u_side * field(ray.origin + s * ray.direction);
#endif
        float reach = width * s;
        least = min(least, r / reach);
        if (least <= -1.0) return 0.0;
        before = z;
#ifdef UNDIVIDED
        float d = divided(r);
        z = safe_step(max(max(0.5 * abs(d), d - width * (s + d)), 0.05 * reach), s);
#else
        z = safe_step(max(max(0.5 * abs(r), r - width * (s + r)), 0.05 * reach), s);
#endif
        s += z;
    }
    if (s < range.y) {
        float end = r + (r - last) / before * (range.y - s + z);
        least = max(min(least, end / (width * range.y)), -1.0);
    }
    return 0.5 + 0.31830989 * (least * sqrt(1.0 - least * least) + asin(least));
}
