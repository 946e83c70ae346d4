// Soft shadow: the share of the light's disc that is left free. `width` is the tangent of the light's angular radius. The
// clearance r, over the radius of the disc at that distance, runs from -1 (covered) to 1 (free); an obstacle with a
// straight edge then leaves the share 1/2 + (r sqrt(1 - r^2) + asin r) / pi of the disc.
// The ray goes on inside of obstacles, where the depth stands for the way to the edge. It is never more than that, so that
// what is thinner than the disc lets light through; a cone's shadow does not.
// Steps pass what cannot matter and are half the distance elsewhere, so that the smallest clearance between two samples
// is known to a thirtieth of itself. A disc is never narrower than 64 ulp of the coordinates: the field is known to a few.
// A ray that runs out of steps goes on straight, as its last two samples lead.
// needs: field Ray Surface Light spawn_ray geometric_normal GROWTH safe_step shadow_steps scene_cone u_side
// gives: two_sided_shadow
float two_sided_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = spawn_ray(surface.p, geometric_normal(surface), light.direction, surface.t, start);
    vec2 range = scene_cone(ray, vec2(start, light.distance), width);
    width = max(width, 64.0 * GROWTH);
    float least = 1.0;
    float s = range.x;
    float z = 0.0;
    float before = 0.0;
    float r = 0.0;
    float last = 0.0;
    for (int i = 0; i < shadow_steps && s < range.y; i++) {
        last = r;
        r = u_side * field(ray.origin + s * ray.direction);
        float reach = width * s;
        least = min(least, r / reach);
        if (least <= -1.0) return 0.0;
        before = z;
        z = safe_step(max(max(0.5 * abs(r), r - width * (s + r)), 0.05 * reach));
        s += z;
    }
    if (s < range.y) {
        float end = r + (r - last) / before * (range.y - s + z);
        least = max(min(least, end / (width * range.y)), -1.0);
    }
    return 0.5 + 0.31830989 * (least * sqrt(1.0 - least * least) + asin(least));
}
