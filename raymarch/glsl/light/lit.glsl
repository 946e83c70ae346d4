// The light of a pixel's surface, as far as passes have added it. Alpha is the ambient visibility, or what the samples
// of ambient occlusion so far have found missing.
uniform sampler2D u_lit;

vec4 lit() {
    return texelFetch(u_lit, ivec2(gl_FragCoord.xy), 0);
}
