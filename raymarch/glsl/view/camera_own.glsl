// The ray through a point of the picture, in a shader that computes the values of the frame itself.
Ray camera_ray(vec2 pixel) {
    set_frame();
#ifdef ORTHOGRAPHIC
    vec2 screen = (2.0 * pixel - u_resolution) / u_resolution.y * u_half_height;
    return Ray(u_camera_position + u_camera_frame * vec3(screen, 0.0), -u_camera_frame[2]);
#else
    vec2 screen = (2.0 * pixel - u_resolution) / u_resolution.y * u_tan_half_fov;
    return Ray(u_camera_position, normalize(u_camera_frame * vec3(screen, -1.0)));
#endif
}
