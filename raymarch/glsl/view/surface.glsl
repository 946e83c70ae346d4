// Pass: the surface that each pixel's ray hits, for passes that add light to it.
layout(location = 0) out vec4 out_surface[surface_texels];

uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels

void main() {
    Ray ray = camera_ray(PIXEL + u_jitter);
    Hit hit = trace(ray);
    keep_surface(ray, hit, out_surface);
}
