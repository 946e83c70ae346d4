// A ray in doubt that knows how far it is free, see march/membrane. Between samples in doubt it compares values of the
// field: the way behind a membrane is long at once.
// The doubt at t begins after a sample that is free up to at.t + at.r. `rate`: how much the field falls per unit of it.
void doubt_ahead(inout March at, float t, float derivative, float rate, float noise) {
    at.last_derivative *= rate;
    if (at.r > 0.0 && at.t + at.r < t) {
        at.t += at.r;
        at.r = noise;
    }
    doubt(at, t, value_there, rate * derivative);
}

bool enters_ahead(inout March at, float t, float noise) {
    bool inside = enters(at, t, value_there, noise);
    if (in_doubt(at)) return false;
    at.r = inside ? at.r - noise : max(at.r - noise, 0.0);
    if (inside) approach = -at.last_derivative;
    return inside;
}
