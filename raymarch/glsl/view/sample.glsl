// Pass: one sample of each pixel: its linear colour, and the visible surface, by which a later frame recognises it.
layout(location = 0) out vec4 out_color;
layout(location = 1) out vec4 out_surface;  // depth along the ray, -1 for the sky; normal; material

uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels

// A unit vector as two numbers: the octahedron unfolded to a square (Meyer et al. 2010).
vec2 encode_octahedral(vec3 n) {
    n /= abs(n.x) + abs(n.y) + abs(n.z);
    vec2 folded = (1.0 - abs(n.yx)) * vec2(n.x < 0.0 ? -1.0 : 1.0, n.y < 0.0 ? -1.0 : 1.0);
    return n.z < 0.0 ? folded : n.xy;
}

void main() {
    Ray ray = camera_ray(PIXEL + u_jitter);
    Hit hit = trace(ray);
    out_color = vec4(shade(ray, hit), 1.0);
    out_surface = vec4(-1.0, 0.0, 0.0, -1.0);
    if (hit.found) {
        vec3 p = ray.origin + hit.t * ray.direction;
        vec3 normal = u_side * visible_side(u_side * surface_normal(p, ray.direction), ray.direction);
        out_surface = vec4(hit.t, encode_octahedral(normal), material_index(p));
    }
}
