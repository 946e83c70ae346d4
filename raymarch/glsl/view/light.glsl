// Pass: some more lights on the surface of each pixel. The first ones come after emission and the sky's light.
layout(location = 0) out vec4 out_lit;

uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels
uniform int u_first_light;
uniform int u_end_light;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy + u_jitter);
    Hit hit = trace(ray);
    out_lit = hit.found ? add_lights(ray, hit, lit(), u_first_light, u_end_light) : vec4(0.0);
}
