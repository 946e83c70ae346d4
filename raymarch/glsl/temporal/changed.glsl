// Reprojection for scenes with motion or changing light: the motion vector of a point, and the number of samples to
// keep, from the change of its colour since the previous frame. See temporal/before.
uniform bool u_changed;  // false if the scene is as in the previous frame
uniform sampler2D u_earlier_color;
uniform sampler2D u_earlier_motion;

const float ROUNDING = 1.0e-5;  // relative difference of colours that counts as unchanged

vec3 motion_vector(ivec2 at) {
    vec4 motion = u_changed ? texelFetch(u_earlier_motion, at, 0) : vec4(0.0);
    return finite(motion) ? motion.xyz : vec3(0.0);
}

// The number m of samples that minimises the error. If a colour changes by d per frame, their mean lags behind by m d,
// and noise of variance v is reduced to v / (2 m + 1). The sum m^2 d^2 + v / (2 m + 1) is least where
// m (2 m + 1)^2 = v / d^2, which the cubic below solves to within .04. The largest change among 49 pixels counts,
// because few samples show a moving edge of a shadow or of a reflection.
float samples_kept(ivec2 at, float most) {
    if (!u_changed) return most;
    ivec2 last = textureSize(u_color, 0) - 1;
    vec4 own = texelFetch(u_earlier_color, at, 0);
    if (!finite(own) || own.a == 0.0) return 0.0;
    vec3 sum = vec3(0.0);
    vec3 squares = vec3(0.0);
    float count = 0.0;
    float change = 0.0;
    for (int y = -3; y <= 3; y++) {
        for (int x = -3; x <= 3; x++) {
            ivec2 around = clamp(at + ivec2(x, y), ivec2(0), last);
            vec4 now = texelFetch(u_color, around, 0);
            vec4 before = texelFetch(u_earlier_color, around, 0);
            if (!finite(now)) continue;
            if (max(abs(x), abs(y)) <= 1) {
                sum += now.rgb;
                squares += now.rgb * now.rgb;
                count += 1.0;
            }
            if (!finite(before) || before.a == 0.0) continue;
            vec3 apart = max(abs(now.rgb - before.rgb) - ROUNDING * abs(now.rgb), 0.0);
            change = max(change, dot(apart, apart));
        }
    }
    if (count == 0.0) return most;
    vec3 mean = sum / count;
    float noise = 0.25 * dot(max(squares / count - mean * mean, 0.0), vec3(1.0));
    if (most * (2.0 * most + 1.0) * (2.0 * most + 1.0) * change <= noise) return most;
    return min(most, pow(0.25 * noise / change + 0.037037, 0.3333333) - 0.3333333);
}

// The colour of a moving pixel with a short history. A sample off the pixel's centre is worse than one at the centre,
// so it is mixed with the mean of the samples around, weighted by a Gaussian about the centre. The Gaussian's width
// minimises the error at straight edges. `share` is the weight of the sample itself, which grows with the history.
vec4 filter_sample(ivec2 at, vec4 color, vec2 jitter, float share) {
    if (share >= 1.0) return color;
    ivec2 last = textureSize(u_color, 0) - 1;
    vec4 sum = vec4(0.0);
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec4 around = texelFetch(u_color, clamp(at + ivec2(x, y), ivec2(0), last), 0);
            vec2 off = jitter + vec2(x, y);
            if (finite(around)) sum += exp(-1.8 * dot(off, off)) * vec4(around.rgb, 1.0);
        }
    }
    return sum.w > 0.0 ? vec4(mix(sum.rgb / sum.w, color.rgb, share), color.a) : color;
}
