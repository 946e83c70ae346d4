// A scene without motion: points keep their positions and colours.
// needs:
// gives: way_before samples_kept at_middle
vec3 way_before(ivec2 at) {
    return vec3(0.0);
}

float samples_kept(ivec2 at, float most) {
    return most;
}

vec4 at_middle(ivec2 at, vec4 color, vec2 jitter, float share) {
    return color;
}
