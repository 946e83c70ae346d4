// The first sample of a ray that starts at a point of its own. Its sign tells whether the ray starts inside a solid; the
// ray then hits the inner surface. Where a ray enters the scene's box, or starts in a clip plane, it may start on a surface.
// Rounding must not put it inside.
void enter(Ray ray, inout March at) {
#ifdef ANALYTIC
    at.r = 0.0;  // `range_of` has found the sign
#else
    vec3 widths = hit_widths(ray);
#ifdef ORTHOGRAPHIC
    float width = widths.x * at.t + hit_width(widths);
#else
    float width = widths.x + hit_width(widths) * at.t;
#endif
    float r = field(ray.origin + at.t * ray.direction);
    u_side = r < -width ? -1.0 : 1.0;
    at.r = abs(r);
#endif
}
