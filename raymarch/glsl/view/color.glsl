// Pass: the linear colour of each pixel.
layout(location = 0) out vec4 out_color;

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    Hit hit = trace(ray);
    out_color = vec4(shade(ray, hit), 1.0);
}
