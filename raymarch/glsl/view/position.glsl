// Pass: the point that each pixel shows.
layout(location = 0) out vec4 out_position;  // in the coordinates of the scene; distance along the ray: -1 for a miss

uniform vec3 u_origin;  // of the shader's coordinates, in those of the scene

void main() {
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    out_position = hit.found ? vec4(u_origin + (ray.origin + hit.t * ray.direction), hit.t) : vec4(0.0, 0.0, 0.0, -1.0);
}
