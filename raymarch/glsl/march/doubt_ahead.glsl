// Begins a doubt at t after a sample that is free up to at.t + at.r, see march/membrane. In doubt, a ray compares values
// of the field: `rate` is how much it falls per unit of the way to the surface.
void doubt_ahead(inout March at, float t, float derivative, float rate, float noise) {
    at.last_derivative *= rate;
    if (at.r > 0.0 && at.t + at.r < t) {
        at.t += at.r;
        at.r = noise;
    }
    doubt(at, t, value_there, rate * derivative);
}
