// Pass: some more samples of light on the surface of each pixel. The first ones come after emission.
layout(location = 0) out vec4 out_lit;

uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels
uniform int u_first_sample;
uniform int u_end_sample;

void main() {
    Ray ray = camera_ray(PIXEL + u_jitter);
    out_lit = add_light(ray, lit(), u_first_sample, u_end_sample);
}
