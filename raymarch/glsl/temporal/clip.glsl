// Clips the history's colour towards the mean of the colours around the new sample until it is within their spread
// (Karis 2014, Salvi 2016), in YCoCg.
uniform sampler2D u_color;

const float SPREAD = 1.0;  // largest deviation of a history's colour, in standard deviations

vec3 to_ycocg(vec3 c) {
    return vec3(0.25 * c.r + 0.5 * c.g + 0.25 * c.b, 0.5 * c.r - 0.5 * c.b, -0.25 * c.r + 0.5 * c.g - 0.25 * c.b);
}

vec3 from_ycocg(vec3 c) {
    return vec3(c.x + c.y - c.z, c.x + c.z, c.x - c.y - c.z);
}

vec3 clipped(vec3 color) {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(u_color, 0) - 1;
    vec3 sum = vec3(0.0);
    vec3 squares = vec3(0.0);
    float count = 0.0;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec4 texel = texelFetch(u_color, clamp(at + ivec2(x, y), ivec2(0), last), 0);
            if (!finite(texel)) continue;
            vec3 c = to_ycocg(texel.rgb);
            sum += c;
            squares += c * c;
            count += 1.0;
        }
    }
    if (count == 0.0) return color;
    vec3 mean = sum / count;
    vec3 deviation = SPREAD * sqrt(max(squares / count - mean * mean, 1.0e-12));  // rounding may give less than 0
    vec3 away = to_ycocg(color) - mean;
    vec3 outside = abs(away) / deviation;
    return from_ycocg(mean + away / max(1.0, max(outside.x, max(outside.y, outside.z))));
}
