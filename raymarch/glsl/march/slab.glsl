// Clips a ray's range to the slab between two planes perpendicular to an axis.
vec2 slab(vec2 range, float origin, float direction, float lower, float upper) {
    return above(below(range, origin, direction, upper), origin, direction, lower);
}
