// The mean of a history and a new sample. Alpha counts the samples; what is not finite counts none.
vec4 joined(vec4 before, vec4 color) {
    if (!finite(before)) before = vec4(0.0);
    if (!finite(color)) color = vec4(0.0);
    float count = before.a + color.a;
    return vec4(mix(before.rgb, color.rgb, count > 0.0 ? color.a / count : 0.0), count);
}
