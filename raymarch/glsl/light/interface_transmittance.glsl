// Diffuse transmittance of the microfacet interface, relative to f0's part: light that enters, is scattered diffusely
// and leaves again. It is (1 - albedo(l)) (1 - albedo(v)) / (1 - mean albedo), with `albedo_f90` as albedo (Kelemen and
// Szirmay-Kalos 2001). The mean, 2 times the integral of the cosine times `albedo_f90`, has a closed form. For smooth
// surfaces this is 21/20 (1 - (1 - l)^5) (1 - (1 - v)^5), the diffuse part of Ashikhmin and Shirley (2000).
float interface_transmittance(float l, float v, float r) {
    float power = 5.0 + r * (6.06 * r - 7.04);
    float mean = 2.0 * albedo_f90(0.0, r) / ((power + 1.0) * (power + 2.0));
    return (1.0 - albedo_f90(l, r)) * (1.0 - albedo_f90(v, r)) / (1.0 - mean);
}
