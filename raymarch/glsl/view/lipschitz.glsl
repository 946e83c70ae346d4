// Pass: the largest slopes of four nodes along the rays of a pixel.
layout(location = 0) out vec4 out_slopes;  // one component per node
layout(location = 1) out vec4 out_place;  // of the first node: point, and distance between the two samples
layout(location = 2) out vec4 out_color;

void main() {
    watch();
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    out_color = vec4(shade(ray, hit), 1.0);
    out_slopes = steepest();
    out_place = steepest_place();
}
