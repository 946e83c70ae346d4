// The light of a pixel's surface, as far as passes have added it; alpha is the ambient visibility.
uniform sampler2D u_lit;

vec4 lit() {
    return texelFetch(u_lit, ivec2(gl_FragCoord.xy), 0);
}
