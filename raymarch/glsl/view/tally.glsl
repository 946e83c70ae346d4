// Pass: evaluations of the field and its gradient by all rays of a pixel.
layout(location = 0) out vec4 out_tally;  // of all kinds, by shadow rays, samples of ambient occlusion, bounces

void main() {
    pixel_color(PIXEL);
    out_tally = vec4(dot(evaluations_of_kinds, vec4(1.0)), evaluations_of_kinds.yzw);
}
