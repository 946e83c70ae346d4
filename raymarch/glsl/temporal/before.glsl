// Pass: the positions of this frame's visible points in the previous frame, and their colours there. All uniforms are
// those of the previous frame; values of this frame have names of their own. A point that was not on a surface then did
// not exist.
layout(location = 0) out vec4 out_color;  // alpha is 0 if the point did not exist
layout(location = 1) out vec4 out_motion;  // motion vector: previous minus current position

uniform vec3 u_now_position;
uniform mat3 u_now_frame;
#ifdef ORTHOGRAPHIC
uniform float u_now_half_height;
#else
uniform float u_now_tan_half_fov;
#endif
uniform vec2 u_jitter;

// The transforms give the point in object space. If the shape itself changed, the point is moved onto its surface.
bool on_surface(inout vec3 p, vec3 direction, float pixel) {
    float r = field(p);
    if (abs(r) <= 0.1 * pixel) return true;
    vec3 normal = surface_normal(p, direction);
    float step_length = r;
    for (int i = 0; i < 3 && abs(r) > 0.1 * pixel; i++) {
        p -= step_length * normal;
        float next = field(p);
        step_length = next / max((r - next) / step_length, 0.25);  // secant step
        r = next;
    }
    return abs(r) <= pixel;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
#ifdef ORTHOGRAPHIC
    vec2 screen = (2.0 * (PIXEL + u_jitter) - u_resolution) / u_resolution.y * u_now_half_height;
    vec3 start = u_now_position + u_now_frame * vec3(screen, 0.0);
    vec3 direction = -u_now_frame[2];
#else
    vec2 screen = (2.0 * (PIXEL + u_jitter) - u_resolution) / u_resolution.y * u_now_tan_half_fov;
    vec3 start = u_now_position;
    vec3 direction = normalize(u_now_frame * vec3(screen, -1.0));
#endif
    float t = texelFetch(u_surface, at, 0).x;
    out_motion = vec4(0.0);
    if (t < 0.0) {
        out_color = vec4(shade(Ray(start, direction), no_hit(0.0)), 1.0);
        return;
    }
    vec3 now = start + t * direction;
    vec3 p = previous_position(now);
#ifdef ORTHOGRAPHIC
    bool there = on_surface(p, direction, u_pixel);
    float far = -dot(p - u_camera_position, u_camera_frame[2]);
    Ray ray = Ray(p + far * u_camera_frame[2], -u_camera_frame[2]);
#else
    bool there = on_surface(p, direction, u_pixel * t);
    vec3 to_point = p - u_camera_position;
    float far = length(to_point);
    Ray ray = Ray(u_camera_position, to_point / far);
#endif
#ifdef OWN_START
    u_side = dot(surface_normal(p, ray.direction), ray.direction) > 0.0 ? -1.0 : 1.0;
#endif
    Hit hit = no_hit(far);
    hit.found = true;
    out_color = vec4(there ? shade(ray, hit) : vec3(0.0), there ? 1.0 : 0.0);
    out_motion = vec4(p - now, 0.0);
}
