// Pixels at rest in a picture in which something moves, for a camera that rests. Their histories are the means of all
// their samples. `nine` is 9, or 0 where the answer is not needed: some drivers execute both sides of a branch, but not
// a loop that has no turns.

// True if a surface around a pixel moves.
bool moves_around(ivec2 at, int nine) {
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int k = 0; k < nine; k++) {
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

// True if two surfaces of one pixel have a material and about a distance; then they are the same also by `is_same`. Or
// both are the sky.
bool is_alike(vec4 before, vec4 now) {
#ifdef ORTHOGRAPHIC
    return before.w == now.w && abs(before.x - now.x) <= 0.05 * u_before_half_height;
#else
    return before.w == now.w && abs(before.x - now.x) <= 0.02 * max(now.x, 0.0);
#endif
}

// True if each surface of the history around a pixel is still there. Samples lie up to a pixel from those of the
// history, so any of the nine around a texel may be the same, unless it has moved there. At the edge of the picture, it
// may be the one beside it. Few texels need more than a comparison with the one in their place: they are bits of `odd`.
bool has_stayed(ivec2 at, vec3 direction, int nine) {
    ivec2 last = textureSize(u_surface, 0) - 1;
    int odd = 0;
    for (int k = 0; k < nine; k++) {
        ivec2 around = clamp(at + ivec2(k % 3, k / 3) - 1, ivec2(0), last);
        vec4 before = texelFetch(u_history_surface, around, 0);
        if (!finite(before)) return false;
        bool outermost = any(equal(around, ivec2(0))) || any(equal(around, last));
        if (!outermost && !is_alike(before, texelFetch(u_surface, around, 0))) odd |= 1 << k;
    }
    for (int n = 0; n < 9 * nine && odd != 0; n++) {
        int k = n / 9;
        if ((odd & (1 << k)) != 0) {
            ivec2 around = at + ivec2(k % 3, k / 3) - 1;
            ivec2 beside = around + ivec2(n % 3, (n % 9) / 3) - 1;
            vec4 before = texelFetch(u_history_surface, around, 0);
            bool stays = is_part(before, texelFetch(u_surface, beside, 0), direction);
            if (stays && motion_vector(beside) == vec3(0.0)) odd &= ~(1 << k);
        } else {
            n = 9 * k + 8;
        }
    }
    return odd == 0;
}
