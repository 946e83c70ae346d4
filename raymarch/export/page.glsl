#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
uniform sampler2D u_picture;
uniform vec2 u_size;  // of the surface that is drawn, in pixels
uniform int u_view;  // 0 the picture, 1 depth, 2 evaluations, 3 normals, 4 shapes
uniform float u_scale;  // the least depth, or the most evaluations
out vec4 out_color;

TONED

vec4 texel(ivec2 at) {
    return texelFetch(u_picture, clamp(at, ivec2(0), textureSize(u_picture, 0) - 1), 0);
}

// Linear interpolation, because not all devices filter float textures.
vec4 smoothed(vec2 at) {
    vec2 place = at * vec2(textureSize(u_picture, 0)) - 0.5;
    ivec2 low = ivec2(floor(place));
    vec2 w = place - floor(place);
    if (w.x < 0.001 && w.y < 0.001) return texel(low);
    vec4 under = mix(texel(low), texel(low + ivec2(1, 0)), w.x);
    return mix(under, mix(texel(low + ivec2(0, 1)), texel(low + ivec2(1, 1)), w.x), w.y);
}

VIEWS

void main() {
    vec2 at = gl_FragCoord.xy / u_size;
    vec3 color;
    if (u_view == 0) {
        vec3 light = smoothed(at).rgb;
        vec3 c = clamp(toned(clamp(mix(light, vec3(0.0), isnan(light)), 0.0, 1.0e30)), 0.0, 1.0);
        color = vec3(linear_to_srgb(c.r), linear_to_srgb(c.g), linear_to_srgb(c.b));
    } else {
        vec4 value = texel(ivec2(at * vec2(textureSize(u_picture, 0))));
        vec3 scale = vec3(u_scale);
        if (u_view == 1) color = depth_color(value.x, value.x < 0.0 ? 0.0 : 1.0, scale, scale);
        else if (u_view == 2) color = evaluations_color(value.w, 1.0, scale, scale);
        else if (u_view == 4) {  // grey, in a light from above
            float lit = max(0.0, dot(value.xyz, normalize(vec3(0.4, 0.8, 0.45))));
            color = dot(value.xyz, value.xyz) < 0.25 ? vec3(0.42, 0.55, 0.71) : vec3(0.25 + 0.6 * sqrt(lit));
        } else color = normal_color(value.xyz, 1.0, scale, scale);
    }
    out_color = vec4(color, 1.0);
}
