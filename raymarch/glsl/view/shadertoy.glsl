// Pass: the picture for the screen, as Shadertoy calls it.
void mainImage(out vec4 fragColor, in vec2 fragCoord) {
    fragColor = vec4(picture(fragCoord), 1.0);
}
