// Whether to step to the surface itself: never, for nothing would prove that it is met there.
// needs:
// gives: aims
bool aims(float r, float slope, float near) {
    return false;
}
