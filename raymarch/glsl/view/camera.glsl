// The ray through a point of the picture; a right-handed camera that looks along its own -z.
#ifndef STANDALONE
struct Ray {
    vec3 origin;
    vec3 direction;
};

uniform vec3 u_camera_position;
uniform mat3 u_camera_frame;  // columns: right, up, backward
#ifdef ORTHOGRAPHIC
uniform float u_half_height;  // half the height of the picture, in scene units
#else
uniform float u_tan_half_fov;  // tangent of half the vertical field of view
#endif
uniform vec2 u_resolution;  // size of the whole picture in pixels, also while a tile is drawn

#endif
Ray camera_ray(vec2 pixel) {
#ifdef STANDALONE
    set_frame();
#endif
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
