// Pass: the linear colour of each pixel, averaged over the samples drawn so far; a sample's ray goes through its own
// point of the pixel. Alpha counts the samples. Neither a sample nor a history that is not finite leaves a trace.
// needs: Ray Hit camera_ray trace shade sky finite
// gives: main out_color u_history u_keep u_jitter
layout(location = 0) out vec4 out_color;

uniform sampler2D u_history;
uniform bool u_keep;  // false on the first sample: the history is of something else
uniform vec2 u_jitter;  // from the pixel's middle, in pixels

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy + u_jitter);
    Hit hit = trace(ray);
    vec4 color = vec4(hit.found ? shade(ray, hit) : sky(ray.direction), 1.0);
    vec4 before = texelFetch(u_history, ivec2(gl_FragCoord.xy), 0);
    if (!u_keep || !finite(before)) before = vec4(0.0);
    if (!finite(color)) color = vec4(0.0);
    float count = before.a + color.a;
    out_color = vec4(mix(before.rgb, color.rgb, count > 0.0 ? color.a / count : 0.0), count);
}
