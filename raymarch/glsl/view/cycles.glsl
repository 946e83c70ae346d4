// Pass: the clock cycles that pass on the processor while it draws a pixel, from its ray to its colour.
// needs: Ray Hit camera_ray trace shade sky
// gives: main out_cycles
layout(location = 0) out vec4 out_cycles;  // cycles, and the colour, so that no part of it is left out

void main() {
    uvec2 before = clock2x32ARB();
    Ray ray = camera_ray(gl_FragCoord.xy);
    Hit hit = trace(ray);
    vec3 color = hit.found ? shade(ray, hit) : sky(ray.direction);
    uvec2 after = before;
    // no colour is as dark as this; the clock is read after it is known
    if (color.x > -1.0e30) after = clock2x32ARB();
    out_cycles = vec4(float(after.x - before.x), color);
}
