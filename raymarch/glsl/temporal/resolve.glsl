// Pass: the new sample of each pixel blended with the history. While the picture does not change, the mean of all
// samples. While the camera moves, the history is fetched from the previous position of the point, if the point was
// visible; it is clipped to the colours around the new sample, and old samples lose weight after some frames.
layout(location = 0) out vec4 out_color;  // alpha counts the samples
layout(location = 1) out vec4 out_surface;

uniform bool u_keep;  // false if the history shows another scene
uniform bool u_still;  // true if nothing changed since the history
uniform vec2 u_jitter;

const float MEMORY = 10.0;  // largest number of samples that a moving picture keeps

// The pixel around with the nearest surface: an edge moves with the surface in front.
ivec2 nearest_around(ivec2 at) {
    ivec2 nearest = at;
    float depth = texelFetch(u_surface, at, 0).x;
    ivec2 last = textureSize(u_surface, 0) - 1;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            ivec2 around = clamp(at + ivec2(x, y), ivec2(0), last);
            float other = texelFetch(u_surface, around, 0).x;
            if (other >= 0.0 && (depth < 0.0 || other < depth)) {
                nearest = around;
                depth = other;
            }
        }
    }
    return nearest;
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
        Ray ray = camera_ray(PIXEL + u_jitter);
        ivec2 nearest = nearest_around(at);
        vec3 motion = motion_vector(nearest);
        float kept = samples_kept(at, MEMORY);
        vec2 pixel;
        if (find_in_history(texelFetch(u_surface, nearest, 0), ray.origin + motion, ray.direction, pixel)) {
            // the sample is jittered off the pixel's centre, and so is its previous position
            vec4 seen = history_at(pixel - u_jitter);
            if (finite(seen)) before = vec4(clipped(seen.rgb), min(seen.a, kept));
        }
        if (kept < MEMORY || motion != vec3(0.0)) color = filter_sample(at, color, u_jitter, before.a / MEMORY);
    }
    if (!finite(before)) before = vec4(0.0);
    float count = before.a + color.a;
    out_color = vec4(mix(before.rgb, color.rgb, count > 0.0 ? color.a / count : 0.0), count);
    out_surface = surface;
}
