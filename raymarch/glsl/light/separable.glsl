// The part of the microfacets that is lit and seen, over 4 times both cosines: Smith's form for GGX, as if the one had
// nothing to do with the other (Walter et al. 2007).
// needs:
// gives: masking
float masking(float facing, float seen, float alpha) {
    float square = alpha * alpha;
    float rest = 1.0 - square;
    return 1.0 / ((facing + sqrt(facing * facing * rest + square)) * (seen + sqrt(seen * seen * rest + square)));
}
