// The direction of a ray along an axis. A ray parallel to a plane meets it far away, on its side.
float steep(float direction) {
    return abs(direction) < 1.0e-20 ? 1.0e-20 : direction;
}
