// Pass: the linear colour of each pixel, averaged over the samples so far. Each sample's ray goes through a different
// point of the pixel. Alpha counts the samples. Samples and histories that are not finite are dropped; a
// pixel without any other keeps one.
layout(location = 0) out vec4 out_color;

uniform sampler2D u_history;
uniform bool u_keep;  // false on the first sample: the history shows another scene
uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels

void main() {
    Ray ray = camera_ray(PIXEL + u_jitter);
#ifdef LIT
    Hit hit = kept_hit();
#else
    Hit hit = trace(ray);
#endif
    vec4 color = vec4(shade(ray, hit), 1.0);
    vec4 before = texelFetch(u_history, ivec2(gl_FragCoord.xy), 0);
    if (!u_keep || !finite(before)) before = vec4(0.0);
    if (!finite(color)) {
        out_color = before.a > 0.0 ? before : color;
        return;
    }
    before.a += 1.0;
    out_color = vec4(mix(before.rgb, color.rgb, 1.0 / before.a), before.a);
}
