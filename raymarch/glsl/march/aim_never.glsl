// Whether to step to the surface itself: never, for nothing would prove that it is met there.
// needs:
// gives: aims_at_surface
bool aims_at_surface(float r, float derivative, float near) {
    return false;
}
