// Pixels at rest in a picture in which something moves, for a camera that rests. Their histories are the means of all
// their samples.

// True if a surface around a pixel moves.
bool moves_around(ivec2 at) {
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int k = 0; k < 9; k++) {
        if (motion_vector(clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), last)) != vec3(0.0)) return true;
    }
    return false;
}

// True if a surface of the history is one of this frame, as in `is_same`, or another part of a grazing one: samples of
// a pixel at the horizon are far apart.
bool is_part(vec4 before, vec4 now, vec3 direction) {
    if (is_same(before, now, now.x, direction, true)) return true;
    if (before.x < 0.0 || now.x < 0.0 || before.w != now.w) return false;
    vec3 normal = decode_octahedral(now.yz);
    return abs(dot(normal, direction)) < 0.1 && dot(normal, decode_octahedral(before.yz)) > 0.99;
}

// True if each surface of the history around a pixel is still there. Samples lie up to a pixel from those of the
// history, so any of the nine around a texel may be the same, unless it has moved there. At the edge of the picture, it
// may be the one beside it.
bool has_stayed(ivec2 at, vec3 direction) {
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int k = 0; k < 9; k++) {
        ivec2 around = clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), last);
        vec4 before = texelFetch(u_history_surface, around, 0);
        if (!finite(before)) return false;
        bool stays = is_part(before, texelFetch(u_surface, around, 0), direction);
        stays = stays || any(equal(around, ivec2(0))) || any(equal(around, last));
        for (int i = 0; i < 9 && !stays; i++) {
            ivec2 beside = around + ivec2(i % 3, i / 3) - 1;
            stays = is_part(before, texelFetch(u_surface, beside, 0), direction) && motion_vector(beside) == vec3(0.0);
        }
        if (!stays) return false;
    }
    return true;
}
