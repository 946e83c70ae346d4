// Pass: the new sample of each pixel blended with the history of another picture. The mean of all samples where a pixel
// does not change while others do. Elsewhere the history is fetched from the previous position of the point, if the
// point was visible; it is clipped to the colours around the new sample, and old samples lose weight after some frames.
// See temporal/mean for a picture that stays.
layout(location = 0) out vec4 out_color;  // alpha counts the samples
layout(location = 1) out vec4 out_surface;

uniform bool u_keep;  // false if the history shows another scene
uniform bool u_camera_rests;  // true if the camera is that of the history
uniform vec2 u_jitter;

const float MEMORY = 10.0;  // largest number of samples that a moving pixel keeps

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

// The history of the point that a pixel shows, with at most so many samples. Neighbours of what moves move with it, as
// edges do.
vec4 followed(ivec2 at, Ray ray, vec3 motion, ivec2 nearest, float most) {
    vec2 pixel;
    vec4 surface = texelFetch(u_surface, nearest, 0);
    if (!find_in_history(surface, ray.origin + motion, ray.direction, pixel)) return vec4(0.0);
    // the sample is jittered off the pixel's centre, and so is its previous position
    vec4 seen = history_at(pixel - u_jitter);
    return finite(seen) ? vec4(clipped(seen.rgb), min(seen.a, most)) : vec4(0.0);
}

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 color = texelFetch(u_color, at, 0);
    vec4 surface = texelFetch(u_surface, at, 0);
    if (!finite(color)) color = vec4(0.0);
    vec4 before = vec4(0.0);
    if (u_keep) before = texelFetch(u_history, at, 0);
    int nine = u_keep && u_camera_rests ? 9 : 0;
    if (u_keep) {
        Ray ray = camera_ray(PIXEL + u_jitter);
        // A pixel at rest has a history of its own, unless something has left it.
        bool rests = u_camera_rests && !moves_around(at, nine);
        if (rests && (!finite(before) || !has_stayed(at, ray.direction, nine))) before = vec4(0.0);
        float most = rests ? max(before.a, MEMORY) : MEMORY;
        float kept = samples_kept(at, most);
        if (!rests || kept < most) {
            ivec2 nearest = nearest_around(at);
            vec3 motion = motion_vector(nearest);
            before = followed(at, ray, motion, nearest, rests ? min(before.a, kept) : kept);
            if (kept < MEMORY || motion != vec3(0.0)) color = filter_sample(at, color, u_jitter, before.a / MEMORY);
        }
    }
    out_color = joined(before, color);
    out_surface = surface;
}
