// The part of a ray's range that lies between two planes across one axis.
// needs: below above
// gives: slab
vec2 slab(vec2 range, float origin, float direction, float lower, float upper) {
    return above(below(range, origin, direction, upper), origin, direction, lower);
}
