// Pass: the field where each ray meets a plane, and the length of its gradient there.
layout(location = 0) out vec4 out_slice;  // field, length of its gradient, distance along the ray: -1 for a miss

uniform vec4 u_slice;  // unit normal of the plane, and its offset along the normal

void main() {
    Ray ray = camera_ray(PIXEL);
    float across = dot(u_slice.xyz, ray.direction);
    float beyond = u_slice.w - dot(u_slice.xyz, ray.origin);
    // parallel to the plane: inside it, or it misses
    float t = across == 0.0 ? (beyond == 0.0 ? 0.0 : -1.0) : beyond / across;
    out_slice = vec4(0.0, 0.0, -1.0, 0.0);
    if (t >= 0.0 && t < 1.0e30) {
        vec4 g = field_gradient(ray.origin + t * ray.direction);
        out_slice = vec4(g.w, length(g.xyz), t, 1.0);
    }
}
