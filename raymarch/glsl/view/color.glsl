// Pass: the linear colour of each pixel. Alpha is 0 where the ray ran out of steps, else 1.
layout(location = 0) out vec4 out_color;

void main() {
#ifdef EDGES
    bool done;
    vec3 color = smoothed(PIXEL, done);
    out_color = vec4(color, done ? 1.0 : 0.0);
#else
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    out_color = vec4(shade(ray, hit), hit.done ? 1.0 : 0.0);
#endif
}
