// The colour of a pixel for the screen: the mean of its samples that are finite, tone mapped and encoded in sRGB.
vec3 picture(vec2 pixel) {
#ifdef SAMPLES
    vec4 sum = vec4(0.0);
    for (int i = 0; i < picture_samples; i++) {
        begin_sample(i);
        vec4 color = vec4(pixel_color(pixel + sample_offset(i)).rgb, 1.0);
        if (finite(color)) sum += color;
    }
    vec3 color = sum.rgb / max(sum.a, 1.0);
#else
    vec3 color = pixel_color(pixel).rgb;
    if (!finite(vec4(color, 1.0))) color = vec3(0.0);
#endif
    vec3 c = clamp(toned(clamp(color, 0.0, 1.0e30)), 0.0, 1.0);
    return vec3(linear_to_srgb(c.r), linear_to_srgb(c.g), linear_to_srgb(c.b));
}
