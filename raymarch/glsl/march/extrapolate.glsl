// Whether a ray that ran out of steps would hit a surface before its end, by linear extrapolation of its last two
// samples. A ray that approaches a surface is blocked by it; a ray that recedes from a surface or runs parallel to it
// is not.
bool meets_ahead(float r, float derivative, float rest) {
    return r < -derivative * rest;
}
