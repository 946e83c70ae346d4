// The thin lens of the camera (pbrt-v4, 5.2.3). Rays start on it, and meet in the plane in focus.
uniform vec2 u_lens;  // radius, and distance of the plane in focus

const vec2 LENS_STEP = vec2(0.6287067210378087, 0.5385972572236101);  // the last two of the R4 sequence (Roberts 2018)

// A point of the lens in scene units, to the right and upwards: another one for each sample. Each pixel starts at a
// random point. The square is mapped to the disc by Shirley and Chiu (1997), which keeps areas. Cones start at the
// centre, and are as wide as the lens.
vec2 lens_point() {
#ifdef CONE
    return vec2(0.0);
#endif
    uvec2 pixel = uvec2(PIXEL);
    uint hash = pcg(pixel.x + pcg(pixel.y));
    float x = float(hash >> 8) * 5.9604645e-8;
    float y = float(pcg(hash) >> 8) * 5.9604645e-8;
    vec2 square = 2.0 * fract(vec2(x, y) + float(u_sample) * LENS_STEP) - 1.0;
    bool wide = abs(square.x) > abs(square.y);
    float r = wide ? square.x : square.y;
    if (r == 0.0) return vec2(0.0);
    float angle = 0.78539816 * (wide ? square.y / square.x : 2.0 - square.x / square.y);
    return u_lens.x * r * vec2(cos(angle), sin(angle));
}
