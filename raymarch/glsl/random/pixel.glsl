// Random numbers of a pixel, the same in each frame for the same sample, on every device: an integer hash after PCG
// (Jarzynski and Olano 2020) of the pixel, the sample and a dimension. Independent numbers use different dimensions.
uniform int u_sample;  // samples of the pixel before this one

// In [0, 1).
float random_of_pixel(int dimension) {
    uvec2 pixel = uvec2(PIXEL);
    return float(pcg(pixel.x + pcg(pixel.y + pcg(uint(u_sample) + pcg(uint(dimension))))) >> 8) * 5.9604645e-8;
}
