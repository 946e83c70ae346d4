// Soft shadow: the share of the light's disc that is left free. `width` is the tangent of the light's angular radius. The
// clearance r, over the radius of the disc at that distance, runs from -1 (covered) to 1 (free); an obstacle with a
// straight edge then leaves the share 1/2 + (r sqrt(1 - r^2) + asin r) / pi of the disc.
// The ray goes on inside of obstacles, where the depth stands for the way to the edge. It is never more than that, so that
// what is thinner than the disc lets light through; a cone's shadow does not.
// Steps pass what cannot matter and are half the distance elsewhere, so that the smallest clearance between two samples
// is known to a thirtieth of itself.
// needs: field Ray Surface Light leaving unbent shadow_steps scene_cone u_side
// gives: two_sided_shadow
float two_sided_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    float start;
    Ray ray = leaving(surface.p, unbent(surface), light.direction, surface.t, start);
    vec2 range = scene_cone(ray, vec2(start, light.distance), width);
    float least = 1.0;
    float s = range.x;
    for (int i = 0; i < shadow_steps; i++) {
        if (s >= range.y) break;
        float r = u_side * field(ray.origin + s * ray.direction);
        float reach = width * s;
        least = min(least, r / reach);
        if (least <= -1.0) return 0.0;
        s += max(max(0.5 * abs(r), r - width * (s + r)), 0.05 * reach);
    }
    return 0.5 + 0.31830989 * (least * sqrt(1.0 - least * least) + asin(least));
}
