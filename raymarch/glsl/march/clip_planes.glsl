// The part of a ray between the camera's clip planes, which are perpendicular to the view. A cone starts before the
// near plane, so that it holds the start of each of its rays, and does not end at the far plane.
uniform float u_near;  // distances of the planes from the camera
uniform float u_clip_far;

vec2 between_planes(Ray ray, float far) {
#ifdef CONE
    return vec2(u_near, far);
#endif
    float rate = -dot(u_camera_frame[2], ray.direction);
    return vec2(u_near / rate, min(far, u_clip_far / rate));
}
