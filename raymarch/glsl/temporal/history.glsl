// The colour of the history between pixels: bicubic, because bilinear interpolation would blur it in each frame.
uniform sampler2D u_history;

vec4 cubic(float x) {
    // Catmull-Rom weights at -1, 0, 1 and 2
    return vec4(
        x * (-0.5 + x * (1.0 - 0.5 * x)),
        1.0 + x * x * (-2.5 + 1.5 * x),
        x * (0.5 + x * (2.0 - 1.5 * x)),
        x * x * (-0.5 + 0.5 * x));
}

// The history at a point of the picture, in pixels; colours are at least 0. Not finite if a texel around is not.
vec4 history_at(vec2 pixel) {
    ivec2 last = textureSize(u_history, 0) - 1;
    vec2 corner = floor(pixel - 0.5);
    vec4 across = cubic(pixel.x - 0.5 - corner.x);
    vec4 up = cubic(pixel.y - 0.5 - corner.y);
    vec4 sum = vec4(0.0);
    for (int y = 0; y < 4; y++) {
        for (int x = 0; x < 4; x++) {
            vec4 texel = texelFetch(u_history, clamp(ivec2(corner) + ivec2(x - 1, y - 1), ivec2(0), last), 0);
            sum += across[x] * up[y] * texel;
        }
    }
    if (!finite(sum)) return sum;  // because max(NaN, 0) may be 0
    return vec4(max(sum.rgb, 0.0), texelFetch(u_history, clamp(ivec2(pixel), ivec2(0), last), 0).a);
}
