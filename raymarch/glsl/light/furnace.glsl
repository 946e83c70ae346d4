// What facets give back of even light from all around, as f0 times the first value plus the second, mirroring it once.
// needs: grazing missing_albedo
// gives: furnace
vec2 furnace(float v, float r) {
    float whole = 1.0 - missing_albedo(v, r);
    float edge = min(grazing(v, r), whole);
    return vec2(whole - edge, edge);
}
