// The ray through a point of the picture, in a shader that computes the values of the frame itself.
Ray camera_ray(vec2 pixel) {
    set_frame();
#ifdef ORTHOGRAPHIC
    vec2 screen = (2.0 * pixel - u_resolution) / u_resolution.y * u_half_height;
#ifdef LENS
    vec3 lens = vec3(lens_point(), 0.0);
    vec3 place = u_camera_position + u_camera_frame * (vec3(screen, 0.0) + lens);
    return Ray(place, normalize(u_camera_frame * (vec3(0.0, 0.0, -u_lens.y) - lens)));
#else
    return Ray(u_camera_position + u_camera_frame * vec3(screen, 0.0), -u_camera_frame[2]);
#endif
#else
    vec2 screen = (2.0 * pixel - u_resolution) / u_resolution.y * u_tan_half_fov;
#ifdef LENS
    vec3 lens = vec3(lens_point(), 0.0);
    vec3 direction = normalize(u_camera_frame * (u_lens.y * vec3(screen, -1.0) - lens));
    return Ray(u_camera_position + u_camera_frame * lens, direction);
#else
    return Ray(u_camera_position, normalize(u_camera_frame * vec3(screen, -1.0)));
#endif
#endif
}
