// The part of a ray's range that lies above a plane across one axis.
// needs: below
// gives: above
vec2 above(vec2 range, float origin, float direction, float lower) {
    return below(range, -origin, -direction, -lower);
}
