// How far a ray, or all rays of a cone, are free from t on.
#ifdef EDGES
// The same up to where a surface is nearer than `width`, which grows along the ray.
float wide_way_ahead(Ray ray, float t, float width, float growth) {
    float level = rounding(ray, t) + width;
    vec2 found = field_advance(ray.origin + t * ray.direction, ray.direction, level, growth + SLOPE_ERROR);
#ifdef STRETCH
    adapt_stretch(abs(found.y), level);
#endif
    return free_way(found, level, u_side);
}

#endif
float march_distance(Ray ray, float t) {
#ifdef CONE
    float level = rounding(ray, t) + u_cone * t;
#ifdef WIDE_CONE
    level += u_cone_start;
#endif
    vec2 found = field_advance(ray.origin + t * ray.direction, ray.direction, level, u_cone + SLOPE_ERROR);
#ifdef STRETCH
    adapt_stretch(abs(found.y), level);
#endif
    float r = free_way(found, level, u_side);
    way_behind /= 1.0 + u_cone;
    return r;
#else
#ifdef EDGES
#ifdef ORTHOGRAPHIC
    if (edge_width > 0.0) return wide_way_ahead(ray, t, edge_width, 0.0);
#else
    if (edge_width > 0.0) return wide_way_ahead(ray, t, edge_width * t, edge_width);
#endif
#endif
#ifdef ANALYTIC
    return way_ahead(ray, t, u_side, u_side < 0.0);
#else
    return way_ahead(ray, t, u_side);
#endif
#endif
}
