// The field at t along a ray, and how far from there nothing reaches into a cone with this sine of its half angle.
vec2 free_ahead(Ray ray, float t, float sine) {
    vec3 p = ray.origin + t * ray.direction;
    float level = rounding(ray, t) + sine * t;
#ifdef UNDIVIDED
    vec2 found = undivided_advance(p, ray.direction, level, sine + SLOPE_ERROR);
#else
    vec2 found = field_advance(p, ray.direction, level, sine + SLOPE_ERROR);
#ifdef ANALYTIC
    found = min(found, solved_advance(p, ray.direction, level, sine + SLOPE_ERROR));
#endif
#endif
    return u_side < 0.0 ? vec2(-found.x, 0.0) : found;
}
