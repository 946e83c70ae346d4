// Clips a ray's range to the half-space below a plane perpendicular to an axis.
vec2 below(vec2 range, float origin, float direction, float upper) {
    float rate = steep(direction);
    float t = (upper - origin) / rate;
    return rate > 0.0 ? vec2(range.x, min(range.y, t)) : vec2(max(range.x, t), range.y);
}
