// Random numbers of a pixel, the same in each frame for the same sample, on every device: an integer hash after PCG
// (Jarzynski and Olano 2020) of the pixel, the sample and a dimension. Independent numbers use different dimensions.
// needs:
// gives: u_sample pcg random_of_pixel
uniform int u_sample;  // samples of the pixel before this one

uint pcg(uint v) {
    v = v * 747796405u + 2891336453u;
    v = ((v >> ((v >> 28) + 4u)) ^ v) * 277803737u;
    return (v >> 22) ^ v;
}

// In [0, 1).
float random_of_pixel(int dimension) {
    uvec2 pixel = uvec2(gl_FragCoord.xy);
    return float(pcg(pixel.x + pcg(pixel.y + pcg(uint(u_sample) + pcg(uint(dimension))))) >> 8) * 5.9604645e-8;
}
