// Enhanced sphere tracing (Bálint and Valasek 2018): the step to where the next sphere would touch this one, if the
// surface were the plane that the last two distances suggest, shortened by a factor. The first step is a plain one, for
// there is no slope yet. Where the ray recedes the plane is never met; the step then ends at the far end of the range.
// After a step that proved too long, the plain step taken in its place counts as the previous one.
// needs: March relaxation
// gives: stride remembered UNDONE
const float UNDONE = -1.0;  // the steepest slope, by which a step is a plain one

float stride(March at, float far) {
    // With the slope m = (r - r_before) / d, (d - r_before + r) / (d + r_before - r) = (1 + m) / (1 - m).
    float z = at.r + relaxation * at.r * (1.0 + at.slope) / max(1.0 - at.slope, 1.0e-6);
    return max(at.r, min(z, far - at.t + at.r));
}

float remembered(float before, float slope) {
    return clamp(slope, -1.0, 1.0);
}
