// The part of a range of a ray that is inside a box.
vec2 clip_to_box(Ray ray, vec2 range, vec3 low, vec3 high) {
#ifdef CONES
    // a cone is inside where any of its points is: its radius moves each plane outwards, as if its axis pointed inwards
#ifdef WIDE_CONE
    float wide = u_cone_start;
#else
    const float wide = 0.0;
#endif
    range = above(range, ray.origin.x + wide, ray.direction.x + u_cone, low.x);
    range = below(range, ray.origin.x - wide, ray.direction.x - u_cone, high.x);
    range = above(range, ray.origin.y + wide, ray.direction.y + u_cone, low.y);
    range = below(range, ray.origin.y - wide, ray.direction.y - u_cone, high.y);
    range = above(range, ray.origin.z + wide, ray.direction.z + u_cone, low.z);
    return below(range, ray.origin.z - wide, ray.direction.z - u_cone, high.z);
#else
#ifdef EDGES
    // wider by what lies in the same pixel
#ifdef ORTHOGRAPHIC
    float pad = EDGE_REACH * u_pixel;
#else
    float pad = EDGE_REACH * u_pixel * (distance(ray.origin, 0.5 * (low + high)) + 0.5 * distance(low, high));
#endif
    low -= pad;
    high += pad;
#endif
    vec3 rate = vec3(steep(ray.direction.x), steep(ray.direction.y), steep(ray.direction.z));
    vec3 a = (low - ray.origin) / rate;
    vec3 b = (high - ray.origin) / rate;
    vec3 first = min(a, b);
    vec3 last = max(a, b);
#ifdef EDGES
    last += 3.0 * pad;  // a ray is followed until it has passed
#endif
    range.x = max(range.x, max(first.x, max(first.y, first.z)));
    range.y = min(range.y, min(last.x, min(last.y, last.z)));
    return range;
#endif
}
