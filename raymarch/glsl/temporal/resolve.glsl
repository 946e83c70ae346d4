// Pass: the new sample of each pixel joined to what earlier frames saw there. While the picture stays the same, the mean
// of all. While the camera moves, the history is fetched from where the point was, if it was seen there; it is clipped to
// the colours around the new sample, and forgets after some frames.
// needs: Ray camera_ray finite u_color u_surface u_history history_at seen_before clipped
// gives: main out_color out_surface u_keep u_still u_jitter MEMORY nearest_around
layout(location = 0) out vec4 out_color;  // alpha counts the samples
layout(location = 1) out vec4 out_surface;

uniform bool u_keep;  // false if the history is of something else
uniform bool u_still;  // true if nothing changed since the history
uniform vec2 u_jitter;

const float MEMORY = 10.0;  // samples that a moving picture remembers

// The nearest of the surfaces around: an edge moves with what it is the edge of.
vec4 nearest_around(vec4 surface) {
    ivec2 at = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec4 around = texelFetch(u_surface, clamp(at + ivec2(x, y), ivec2(0), last), 0);
            if (around.x >= 0.0 && (surface.x < 0.0 || around.x < surface.x)) surface = around;
        }
    }
    return surface;
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 color = texelFetch(u_color, at, 0);
    vec4 surface = texelFetch(u_surface, at, 0);
    if (!finite(color)) color = vec4(0.0);
    vec4 before = vec4(0.0);
    if (u_keep && u_still) {
        before = texelFetch(u_history, at, 0);
    } else if (u_keep) {
        Ray ray = camera_ray(gl_FragCoord.xy + u_jitter);
        vec2 pixel;
        if (seen_before(nearest_around(surface), ray.origin, ray.direction, pixel)) {
            // the sample lies beside the pixel's middle, and so does where it was
            before = history_at(pixel - u_jitter);
            if (finite(before)) before = vec4(clipped(before.rgb), min(before.a, MEMORY));
        }
    }
    if (!finite(before)) before = vec4(0.0);
    float count = before.a + color.a;
    out_color = vec4(mix(before.rgb, color.rgb, count > 0.0 ? color.a / count : 0.0), count);
    out_surface = surface;
}
