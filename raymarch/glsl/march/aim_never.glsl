// Whether to step to the surface itself: never, because this tracer or refinement does not verify such a step.
bool aims_at_surface(float r, float derivative, float near) {
    return false;
}
