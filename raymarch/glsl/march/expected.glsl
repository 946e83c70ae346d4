// Whether the expected tangent point is within a pixel of the surface, so that the ray can be followed from here.
bool is_expected(March at) {
    float m = at.last_derivative;
    float near = pixel_at(at.t);
#ifdef ADVANCE
    return false;  // the way that is free does not fall as the field does
#endif
    return m < -0.25 && at.kept_t == 0.0 && at.r * (1.0 + m) < 0.5 * near * (1.0 - m);
}
