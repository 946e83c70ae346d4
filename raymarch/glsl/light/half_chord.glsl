// Half of the chord that a sphere of radius r, about a point of the axis at t, cuts from the side of a cone. `sine` is
// that of the cone's half angle.
float half_chord(float r, float t, float sine) {
    return sqrt(max(r * r - t * t * sine * sine, 0.0));
}
