// Pass: the linear colour of each pixel.
layout(location = 0) out vec4 out_color;

void main() {
    out_color = pixel_color(PIXEL);
}
