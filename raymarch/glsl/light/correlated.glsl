// The part of the microfacets that is lit and seen, over 4 times both cosines: Smith's form for GGX, correlated by height
// (Heitz 2014).
// needs:
// gives: masking
float masking(float facing, float seen, float alpha) {
    float square = alpha * alpha;
    float rest = 1.0 - square;
    return 0.5 / (facing * sqrt(seen * seen * rest + square) + seen * sqrt(facing * facing * rest + square));
}
