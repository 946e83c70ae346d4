// The part of a ray's range that lies below a plane across one axis.
// needs:
// gives: steep below
float steep(float direction) {
    // keeps a ray that runs along the planes from dividing by 0
    return abs(direction) < 1.0e-20 ? 1.0e-20 : direction;
}

vec2 below(vec2 range, float origin, float direction, float upper) {
    float t = (upper - origin) / steep(direction);
    return direction > 0.0 ? vec2(range.x, min(range.y, t)) : vec2(max(range.x, t), range.y);
}
