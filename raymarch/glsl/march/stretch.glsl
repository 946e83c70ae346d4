// The stretch of a ray on which bounds of the slope are asked: a quarter of the ray at first, twice as long after one
// that was free as a whole, else one and a half times the step.
float stretch_ahead;

void begin_stretch(float rest) {
    stretch_ahead = 0.25 * rest;
}

void adapt_stretch(float step, float level) {
    stretch_ahead = step >= stretch_ahead ? 2.0 * stretch_ahead : max(1.5 * step, 16.0 * level);
}
