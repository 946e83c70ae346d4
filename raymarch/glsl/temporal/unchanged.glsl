// A scene without motion: points keep their positions and colours. Its pixels change with the camera, all at once.
vec3 motion_vector(ivec2 at) {
    return vec3(0.0);
}

float samples_kept(ivec2 at, float most) {
    return most;
}

vec4 filter_sample(ivec2 at, vec4 color, vec2 jitter, float share) {
    return color;
}

bool moves_around(ivec2 at, int nine) {
    return true;
}

bool has_stayed(ivec2 at, vec3 direction, int nine) {
    return false;
}
