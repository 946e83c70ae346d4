// The position in the history's picture of a visible point. False if the point was not visible there: if it was outside
// of the picture, or the surface there has another distance, normal or material.
uniform sampler2D u_surface;
uniform sampler2D u_history_surface;
uniform vec3 u_before_position;  // the camera of the history
uniform mat3 u_before_frame;
#ifdef ORTHOGRAPHIC
uniform float u_before_half_height;
#else
uniform float u_before_tan_half_fov;
#endif

// Inverse of `encode_octahedral` in view/sample.
vec3 decode_octahedral(vec2 e) {
    vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
    float below = max(-n.z, 0.0);
    n.xy += vec2(n.x < 0.0 ? below : -below, n.y < 0.0 ? below : -below);
    return normalize(n);
}

// True if the history's surface is this one: same distance, normal and material; or both are sky.
bool is_same(vec4 before, vec4 surface, float depth, vec3 direction, bool edge) {
    if (before.x < 0.0 || surface.x < 0.0) return before.x < 0.0 && surface.x < 0.0;
    vec3 normal = decode_octahedral(surface.yz);
    float slant = max(abs(dot(normal, direction)), 0.05);
#ifdef ORTHOGRAPHIC
    return abs(depth - before.x) * slant <= 0.05 * u_before_half_height
#else
    return abs(depth - before.x) * slant <= 0.02 * depth
#endif
        && (edge || dot(normal, decode_octahedral(before.yz)) >= 0.9) && before.w == surface.w;
}

// True if surfaces around a pixel have other normals. There the normal cannot decide whether the point was visible.
bool is_edge(vec3 normal) {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec4 around = texelFetch(u_surface, clamp(at + ivec2(x, y), ivec2(0), last), 0);
            if (around.x < 0.0 || dot(normal, decode_octahedral(around.yz)) < 0.9) return true;
        }
    }
    return false;
}

bool find_in_history(vec4 surface, vec3 position, vec3 direction, out vec2 pixel) {
    bool hit = surface.x >= 0.0;
#ifdef ORTHOGRAPHIC
    // the sky has one colour, so any pixel of the history will do: that of the point at distance 0
    vec3 to_point = position + max(surface.x, 0.0) * direction - u_before_position;
    vec3 view = to_point * u_before_frame;  // the frame is orthonormal: this multiplies by its transpose
    vec2 size = vec2(textureSize(u_history, 0));
    pixel = 0.5 * (view.xy / u_before_half_height * size.y + size);
#else
    vec3 to_point = hit ? position + surface.x * direction - u_before_position : direction;
    vec3 view = to_point * u_before_frame;  // the frame is orthonormal: this multiplies by its transpose
    if (view.z >= 0.0) return false;
    vec2 size = vec2(textureSize(u_history, 0));
    pixel = 0.5 * (view.xy / -view.z / u_before_tan_half_fov * size.y + size);
#endif
    if (any(lessThan(pixel, vec2(0.0))) || any(greaterThanEqual(pixel, size))) return false;
    // at edges, the samples of a pixel hit either surface, so any texel around may match
    bool edge = hit && is_edge(decode_octahedral(surface.yz));
    ivec2 last = textureSize(u_history_surface, 0) - 1;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec4 before = texelFetch(u_history_surface, clamp(ivec2(pixel) + ivec2(x, y), ivec2(0), last), 0);
#ifdef ORTHOGRAPHIC
            if (finite(before) && is_same(before, surface, -view.z, direction, edge)) return true;
#else
            if (finite(before) && is_same(before, surface, length(to_point), direction, edge)) return true;
#endif
        }
    }
    return false;
}
