// Pass: a step of the pyramid of a bloom: a level from the next finer one, or a level mixed with the next coarser one.
// A texel of a level covers 2 x 2 texels of the next finer level, from the lower left corner of the picture on.
layout(location = 0) out vec4 out_color;

uniform sampler2D u_fine;
uniform sampler2D u_coarse;
uniform bool u_down;
uniform float u_share;  // of the coarser level
uniform vec4 u_last;  // the covers of the last column and row of the finer level, and of the last but one

// Beyond its borders a picture is mirrored, so that no light is lost there.
ivec2 mirrored(ivec2 at, ivec2 size) {
    at = max(at, -1 - at);
    return clamp(min(at, 2 * size - 1 - at), ivec2(0), size - 1);
}

vec4 texel_of(sampler2D level, ivec2 at) {
    return texelFetch(level, mirrored(at, textureSize(level, 0)), 0);
}

// A texel by its weight. Texels of the picture that are not finite are black. All coarser levels are finite.
// Half a pair at the upper end is not mirrored: it has no texel there.
vec4 weighted_texel(ivec2 at) {
    ivec2 size = textureSize(u_fine, 0);
    ivec2 within = mirrored(at, size);
    vec4 found = texelFetch(u_fine, within, 0);
    vec2 cover = mix(vec2(1.0), u_last.zw, equal(within, size - 2));
    cover = mix(cover, u_last.xy, equal(within, size - 1));
    cover *= vec2(1 - ivec2(greaterThanEqual(at, size)) * (size & 1));
    return cover.x * cover.y * vec4(finite(found) ? found.rgb : vec3(0.0), 1.0);
}

// The mask 1 3 3 1 on both axes: that of quadratic B-splines (Chaikin 1974).
vec3 down(ivec2 at) {
    const vec4 mask = vec4(0.125, 0.375, 0.375, 0.125);
    vec4 sum = vec4(0.0);
    int rows = u_down ? 4 : 0;  // software renderers run both sides of a branch, but leave a loop
    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < 4; x++) {
            sum += mask[x] * mask[y] * weighted_texel(2 * at + ivec2(x, y) - 1);
        }
    }
    return sum.rgb / sum.a;
}

// The same mask upwards: linear interpolation between the coarse texels.
vec3 up(ivec2 at) {
    ivec2 odd = at & 1;
    ivec2 first = at / 2 + odd - 1;
    vec2 w = vec2(0.75) - 0.5 * vec2(odd);  // of the texels to the right and above
    vec3 low = mix(texel_of(u_coarse, first).rgb, texel_of(u_coarse, first + ivec2(1, 0)).rgb, w.x);
    vec3 high = mix(texel_of(u_coarse, first + ivec2(0, 1)).rgb, texel_of(u_coarse, first + 1).rgb, w.x);
    return mix(low, high, w.y);
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
