// The first sample of a ray that starts at a point of its own. Its sign tells whether the ray starts inside a solid and
// hits the inner surface. A ray that starts on a surface, at the scene's box or in a clip plane, starts outside.
void enter(Ray ray, inout March at) {
#ifdef ANALYTIC
    at.r = 0.0;  // `range_of` has found the sign
#else
    vec3 widths = hit_widths(ray);
    float width = width_at(widths, hit_width(widths), at.t);
    float r = field(ray.origin + at.t * ray.direction);
    u_side = r < -width ? -1.0 : 1.0;
    at.r = abs(r);
#endif
}
