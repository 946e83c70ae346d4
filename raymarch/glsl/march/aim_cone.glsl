// Whether to step to the surface itself; see march/aim. Cones never do, because they do not hit surfaces.
bool aims_at_surface(float r, float derivative, float near) {
#ifdef CONE
    return false;
#endif
    return derivative < -0.25 && r * (1.0 + derivative) < near * (1.0 - derivative);
}
