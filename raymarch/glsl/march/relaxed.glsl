// Over-relaxed sphere tracing (Keinert et al. 2014): steps are longer than the distance by a fixed factor. A step that
// was too long is replaced by a plain one. After that the ray takes plain steps only (Keinert), or relaxes again
// (Bálint and Valasek 2018), depending on `relax_again`.
const float UNDONE = 2.0;  // no field has this derivative

float step_length(March at, float far) {
    return at.derivative >= UNDONE ? at.r : relaxation * at.r;
}

float averaged_derivative(float before, float derivative) {
    return relax_again || before < UNDONE ? derivative : UNDONE;
}
