// Pass: a step of the pyramid of a bloom: a level from the next finer one, or a level mixed with the next coarser one.
// A texel of a level covers 2 x 2 texels of the next finer level, from the lower left corner of the picture on.
layout(location = 0) out vec4 out_color;

uniform sampler2D u_fine;
uniform sampler2D u_coarse;
uniform bool u_down;
uniform float u_share;  // of the coarser level

// Beyond its borders a picture is mirrored, so that no light is lost there. Texels that are not finite are black.
vec4 texel_of(sampler2D level, ivec2 at) {
    ivec2 size = textureSize(level, 0);
    at = max(at, -1 - at);
    at = clamp(min(at, 2 * size - 1 - at), ivec2(0), size - 1);
    vec4 found = texelFetch(level, at, 0);
    return finite(found) ? found : vec4(0.0);
}

// The 13 bilinear taps of Jimenez (2014), each the mean of 2 x 2 texels: half of a box of 4 x 4 texels about the centre,
// and an eighth of each of four such boxes that are moved by a texel. These are sums of products of columns and rows.
vec3 down(ivec2 at) {
    const float inner[6] = float[6](0.0, 0.25, 0.25, 0.25, 0.25, 0.0);
    const float outer[6] = float[6](0.125, 0.125, 0.25, 0.25, 0.125, 0.125);
    vec3 sum = vec3(0.0);
    for (int y = 0; y < 6; y++) {
        for (int x = 0; x < 6; x++) {
            float weight = 0.5 * (inner[x] * inner[y] + outer[x] * outer[y]);
            sum += weight * texel_of(u_fine, 2 * at + ivec2(x, y) - 2).rgb;
        }
    }
    return sum;
}

// A tent of 3 x 3 coarse texels, interpolated between texels: its weights to the left and right of a texel's centre.
vec3 up(ivec2 at) {
    const vec4 before = vec4(0.0625, 0.3125, 0.4375, 0.1875);
    ivec2 odd = at & 1;
    vec4 across = odd.x == 0 ? before : before.wzyx;
    vec4 along = odd.y == 0 ? before : before.wzyx;
    vec3 sum = vec3(0.0);
    for (int y = 0; y < 4; y++) {
        for (int x = 0; x < 4; x++) {
            sum += across[x] * along[y] * texel_of(u_coarse, at / 2 + odd + ivec2(x, y) - 2).rgb;
        }
    }
    return sum;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    if (u_down) {
        out_color = vec4(down(at), 1.0);
    } else {
        vec4 own = texelFetch(u_fine, at, 0);
        out_color = u_share > 0.0 && finite(own) ? vec4(mix(own.rgb, up(at), u_share), own.a) : own;
    }
}
