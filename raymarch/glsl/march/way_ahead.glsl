// How far a ray is free, from a point p at the length t on: up to where the field falls to its rounding error. At the
// surface and inside, where it is not free, the field less that error. `side` is -1 inside of a solid.
const float SLOPE_ERROR = 1.0e-6;  // of the slope along a ray in float32

float approach = 1.0;  // how much the field falls per unit of the way to the surface, at the last sample that knew it
float way_behind;  // how far the ray is free before the last sample, by the value of the field alone
bool by_distance;  // whether that is also all that is known ahead
#ifdef CUTS
float value_there;  // the field at the last sample, as no surface lies where it falls to 0 and rises again
#endif

float free_way(vec2 found, float level, float side) {
    float r = side * found.x - level;
    way_behind = abs(r);
#ifdef CUTS
    value_there = side * found.x;
#endif
    float way = side * found.y;
    if (way > 0.0 && r > 7.0 * level) approach = min(r / way, 1.0);
    by_distance = way < 1.01 * r;
    return way > 0.0 ? way : r;
}

// From where the field falls to its rounding error to the surface; at most a quarter of the width of a hit.
float way_below_level(Ray ray, float t, float width) {
#ifdef STRETCH
    return 0.0;  // a solid with bounds on a stretch ends its rays at the surface itself
#else
    return min(rounding(ray, t) / approach, 0.25 * width);
#endif
}

#ifdef ANALYTIC
float way_ahead(Ray ray, float t, float side, bool inside) {
#else
float way_ahead(Ray ray, float t, float side) {
#endif
    float level = rounding(ray, t);
    vec3 p = ray.origin + t * ray.direction;
    vec2 found = field_advance(p, ray.direction, level, SLOPE_ERROR);
#ifdef ANALYTIC
    if (inside) found.x = min(found.x, solved_field(p));
#endif
#ifdef STRETCH
    adapt_stretch(abs(found.y), level);
#endif
    return free_way(found, level, side);
}
