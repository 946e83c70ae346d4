// Whether to step to the surface itself: if a step to the expected tangent point would end within an epsilon of it, and
// the derivative is steep enough for the gap r (1 + derivative) / -derivative to be at most a few epsilons.
bool aims_at_surface(float r, float derivative, float near) {
#ifdef CONE
    return false;
#endif
#ifdef EDGES
    if (edge_width > 0.0) return false;
#endif
    return derivative < -0.25 && r * (1.0 + derivative) < near * (1.0 - derivative);
}
