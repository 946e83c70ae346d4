// Pass: the mean of the samples of each pixel so far, as Shadertoy calls a buffer that reads itself. Each frame adds a
// sample. Alpha holds the number of samples and the width of the picture.
const float LARGEST_COUNT = 1023.0;

void mainImage(out vec4 fragColor, in vec2 fragCoord) {
    vec4 before = texelFetch(iChannel0, ivec2(fragCoord), 0);
    float width = floor(before.a / 1024.0);
    float count = before.a - 1024.0 * width;
    // the first frame, a mouse that drags, and a picture of another size start again
    bool again = iFrame == 0 || iMouse.z > 0.0 || width != floor(iResolution.x) || !finite(before);
    if (again) {
        before = vec4(0.0);
        count = 0.0;
    }
    if (count < LARGEST_COUNT) {
        begin_sample(int(count));
        Ray ray = camera_ray(fragCoord + sample_offset(int(count)));
        Hit hit = trace(ray);
        vec4 color = vec4(shade(ray, hit), 1.0);
        count += 1.0;
        if (finite(color)) before.rgb = mix(before.rgb, color.rgb, 1.0 / count);
    }
    fragColor = vec4(before.rgb, 1024.0 * floor(iResolution.x) + count);
}
