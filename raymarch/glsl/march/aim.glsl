// Whether to step to the surface itself: if a step to where the spheres touch would end within an epsilon of it, and the
// slope is steep enough for what lies between, r (1 + slope) / -slope, to be no more than a few epsilons.
// needs:
// gives: aims
bool aims(float r, float slope, float near) {
    return slope < -0.25 && r * (1.0 + slope) < near * (1.0 - slope);
}
