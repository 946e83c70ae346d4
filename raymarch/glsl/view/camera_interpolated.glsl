// The ray through a point of the picture; a right-handed camera that looks along its own -z. The direction is computed
// at the corners, interpolated, and normalised at each pixel.
struct Ray {
    vec3 origin;
    vec3 direction;
};

uniform vec3 u_camera_position;
uniform vec2 u_resolution;  // size of the whole picture in pixels, also while a tile is drawn
in vec3 ray_direction;

Ray camera_ray(vec2 pixel) {
    return Ray(u_camera_position, normalize(ray_direction));
}
