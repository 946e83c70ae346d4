// The camera of a shader that computes it itself: `place_camera` sets these variables for each ray.
struct Ray {
    vec3 origin;
    vec3 direction;
};

uniform vec2 u_resolution;  // size of the whole picture in pixels
uniform vec3 u_orbit;  // angle about the up axis and angle above the horizon in radians, logarithm of the distance
uniform vec2 u_pan;  // translation to the right and upwards, relative to the distance of the target
vec3 u_camera_position;
mat3 u_camera_frame;  // columns: right, up, backward
#ifdef ORTHOGRAPHIC
float u_half_height;  // half the height of the picture, in scene units
#else
float u_tan_half_fov;  // tangent of half the vertical field of view
#endif
const float HIGHEST = 1.55;  // an orbit ends just before the camera would look along the up axis

// The scene's camera, turned about its target by u_orbit and moved by u_pan.
void place_camera(vec3 position, vec3 target, vec3 up) {
    vec3 away = position - target;
    vec3 place = position;
    if (u_orbit != vec3(0.0)) {
        vec3 axis = normalize(up);
        float size = length(away);
        vec3 across = normalize(cross(axis, away));
        float elevation = asin(clamp(dot(away, axis) / size, -1.0, 1.0));
        if (u_orbit.y != 0.0) elevation = clamp(elevation + u_orbit.y, -HIGHEST, HIGHEST);
        vec3 ahead = cos(u_orbit.x) * cross(across, axis) + sin(u_orbit.x) * across;
#ifdef ORTHOGRAPHIC
        away = size * (cos(elevation) * ahead + sin(elevation) * axis);
        u_half_height *= exp(u_orbit.z);
#else
        away = size * exp(u_orbit.z) * (cos(elevation) * ahead + sin(elevation) * axis);
#endif
        place = target + away;
    }
    vec3 backward = normalize(away);
    vec3 right = normalize(cross(up, backward));
    vec3 above = cross(backward, right);
    u_camera_frame = mat3(right, above, backward);
    u_camera_position = place;
#ifdef ORTHOGRAPHIC
    u_camera_position += exp(u_orbit.z) * length(away) * (u_pan.x * right + u_pan.y * above);
#else
    if (u_pan != vec2(0.0)) u_camera_position += length(away) * (u_pan.x * right + u_pan.y * above);
#endif
}
