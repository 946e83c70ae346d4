// Pass: the GPU clock cycles that a pixel takes, from its ray to its colour.
layout(location = 0) out vec4 out_cycles;  // cycles, and the colour, so that its computation is not optimised away

void main() {
    uvec2 before = clock2x32ARB();
    vec3 color = pixel_color(PIXEL).rgb;
    uvec2 after = before;
    // always true, and forces the clock to be read after the colour is known
    if (color.x > -1.0e30) after = clock2x32ARB();
    out_cycles = vec4(float(after.x - before.x), color);
}
