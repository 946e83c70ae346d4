// Pass: the first invalid value of each pixel: in the field at any evaluation, in the gradient and material at the hit,
// or in the colour.
layout(location = 0) out vec4 out_fault;  // code, value, number of evaluations with a fault, 1
layout(location = 1) out vec4 out_place;  // point, and the final distance along the primary ray
layout(location = 2) out vec4 out_color;

void main() {
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    vec3 p = ray.origin + hit.t * ray.direction;
    if (hit.found) note(surface_faults(p), p);
    vec4 color = vec4(shade(ray, hit), 1.0);
    if (!finite(color)) note(vec2(color_fault, color.r + color.g + color.b), p);
    out_fault = vec4(noted(), 1.0);
    out_place = vec4(noted_place(), hit.t);
    out_color = color;
}
