// Whether a ray that ran out of steps would hit a surface before its end, by linear extrapolation.
bool meets_ahead(float r, float derivative, float rest) {
    return r < -derivative * rest;
}
