// Pass: where the points that this frame sees were in the frame before, and what colour they had there. All uniforms are
// those of the frame before; what is read of this frame has names of its own. A point that was on no surface then was not
// there.
// needs: Ray Hit shade sky field surface_normal place_before u_surface u_camera_position u_pixel u_resolution
// gives: main out_color out_way u_now_position u_now_frame u_now_tan_half_fov u_jitter on_surface
layout(location = 0) out vec4 out_color;  // alpha is 0 if the point was not there
layout(location = 1) out vec4 out_way;  // from where the point is now to where it was

uniform vec3 u_now_position;
uniform mat3 u_now_frame;
uniform float u_now_tan_half_fov;
uniform vec2 u_jitter;

// The transforms lead to the point of the shape; if the shape itself changed, its surface is beside it.
bool on_surface(inout vec3 p, vec3 direction, float pixel) {
    float r = field(p);
    if (abs(r) <= 0.1 * pixel) return true;
    vec3 normal = surface_normal(p, direction);
    float way = r;
    for (int i = 0; i < 3 && abs(r) > 0.1 * pixel; i++) {
        p -= way * normal;
        float next = field(p);
        way = next / max((r - next) / way, 0.25);  // along the secant
        r = next;
    }
    return abs(r) <= pixel;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec2 screen = (2.0 * (gl_FragCoord.xy + u_jitter) - u_resolution) / u_resolution.y * u_now_tan_half_fov;
    vec3 direction = normalize(u_now_frame * vec3(screen, -1.0));
    float t = texelFetch(u_surface, at, 0).x;
    out_way = vec4(0.0);
    if (t < 0.0) {
        out_color = vec4(sky(direction), 1.0);
        return;
    }
    vec3 now = u_now_position + t * direction;
    vec3 p = place_before(now);
    bool there = on_surface(p, direction, u_pixel * t);
    vec3 way = p - u_camera_position;
    float far = length(way);
    Ray ray = Ray(u_camera_position, way / far);
    Hit hit = Hit(true, true, far, 0.0, 0.0, 0.0, 0.0);
    out_color = vec4(there ? shade(ray, hit) : vec3(0.0), there ? 1.0 : 0.0);
    out_way = vec4(p - now, 0.0);
}
