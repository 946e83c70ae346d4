// Over-relaxed sphere tracing (Keinert et al. 2014): steps are longer than the distance by a fixed factor. In place of
// one that was too long a plain step is taken. After that the ray goes on with plain steps (Keinert), or relaxes again
// (Bálint and Valasek 2018), as `relax_again` says.
// needs: March relaxation relax_again
// gives: step_length averaged_derivative UNDONE
const float UNDONE = 2.0;  // no derivative of a field

float step_length(March at, float far) {
    return at.derivative >= UNDONE ? at.r : relaxation * at.r;
}

float averaged_derivative(float before, float derivative) {
    return relax_again || before < UNDONE ? derivative : UNDONE;
}
