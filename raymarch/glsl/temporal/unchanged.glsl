// A scene without motion: points keep their positions and colours.
vec3 motion_vector(ivec2 at) {
    return vec3(0.0);
}

float samples_kept(ivec2 at, float most) {
    return most;
}

vec4 filter_sample(ivec2 at, vec4 color, vec2 jitter, float share) {
    return color;
}
