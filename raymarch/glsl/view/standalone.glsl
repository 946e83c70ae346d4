// Pass: the picture for the screen, in one draw call.
layout(location = 0) out vec4 out_color;  // sRGB

void main() {
    out_color = vec4(picture(PIXEL), 1.0);
}
