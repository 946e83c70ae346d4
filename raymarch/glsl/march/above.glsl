// Clips a ray's range to the half-space above a plane perpendicular to an axis.
vec2 above(vec2 range, float origin, float direction, float lower) {
    return below(range, -origin, -direction, -lower);
}
