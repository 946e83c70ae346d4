// Plain sphere tracing (Hart 1996): each step is the distance itself, so no surface is stepped over.
// needs: March safe_step
// gives: stride remembered UNDONE
const float UNDONE = -1.0;  // no step is too long

float stride(March at, float far) {
    return safe_step(at.r);
}

float remembered(float before, float slope) {
    return slope;
}
