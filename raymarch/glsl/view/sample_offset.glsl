// Points of a pixel for its samples: offsets in pixels from the centre, which is sample 0.
const vec2 R2 = vec2(0.7548776662466927, 0.5698402909980532);  // the R2 sequence (Roberts 2018)

vec2 sample_offset(int index) {
    return fract(0.5 + float(index) * R2) - 0.5;
}
