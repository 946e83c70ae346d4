// Over-relaxed sphere tracing (Keinert et al. 2014): steps are longer than the distance by a fixed factor. In place of
// one that was too long a plain step is taken. After that the ray goes on with plain steps (Keinert), or relaxes again
// (Bálint and Valasek 2018), as `relax_again` says.
// needs: March relaxation relax_again
// gives: stride remembered UNDONE
const float UNDONE = 2.0;  // no slope of a field

float stride(March at, float far) {
    return at.slope >= UNDONE ? at.r : relaxation * at.r;
}

float remembered(float before, float slope) {
    return relax_again || before < UNDONE ? slope : UNDONE;
}
