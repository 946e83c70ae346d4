// Whether to step to the surface itself: if a step to where the spheres touch would end within an epsilon of it, and the
// derivative is steep enough for what lies between, r (1 + derivative) / -derivative, to be no more than a few epsilons.
// needs:
// gives: aims_at_surface
bool aims_at_surface(float r, float derivative, float near) {
    return derivative < -0.25 && r * (1.0 + derivative) < near * (1.0 - derivative);
}
