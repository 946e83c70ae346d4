// Whether a ray that ran out of steps meets a surface before its end. Its last two samples lead on in a straight line, so
// that a ray that comes nearer and nearer to a wall is stopped by it, and one that recedes or runs beside a wall is not.
// needs:
// gives: meets_ahead
bool meets_ahead(float r, float derivative, float rest) {
    return r < -derivative * rest;
}
