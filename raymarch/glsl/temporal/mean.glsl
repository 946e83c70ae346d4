// Pass: the mean of all samples of each pixel, while the picture does not change.
layout(location = 0) out vec4 out_color;  // alpha counts the samples
layout(location = 1) out vec4 out_surface;

void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    out_color = joined(texelFetch(u_history, at, 0), texelFetch(u_color, at, 0));
    out_surface = texelFetch(u_surface, at, 0);
}
