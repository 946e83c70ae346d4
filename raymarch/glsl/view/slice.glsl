// Pass: the field where each ray meets a plane, and the size of its gradient there.
// needs: Ray camera_ray field_gradient
// gives: main out_slice u_slice
layout(location = 0) out vec4 out_slice;  // field, size of its gradient, distance along the ray: -1 where it is not met

uniform vec4 u_slice;  // normal of the plane, of length 1, and its offset along it

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy);
    float across = dot(u_slice.xyz, ray.direction);
    float beyond = u_slice.w - dot(u_slice.xyz, ray.origin);
    // along the plane: in it, or never met
    float t = across == 0.0 ? (beyond == 0.0 ? 0.0 : -1.0) : beyond / across;
    out_slice = vec4(0.0, 0.0, -1.0, 0.0);
    if (t >= 0.0 && t < 1.0e30) {
        vec4 g = field_gradient(ray.origin + t * ray.direction);
        out_slice = vec4(g.w, length(g.xyz), t, 1.0);
    }
}
