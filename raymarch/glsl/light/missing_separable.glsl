// Energy that single scattering by white microfacets loses at a cosine: 1 minus their directional albedo. A fit to the
// integral of GGX with separable masking, between 0.01 below and 0.005 above.
float missing_albedo(float cosine, float roughness) {
    float a = max(roughness * roughness, 1.0e-6);
    float c = clamp(cosine, 1.0e-4, 1.0);
    vec3 powers = vec3(1.0, a, a * a);
    vec3 terms = vec3(dot(vec3(4.5024, 2.3809, 102.1036), powers), dot(vec3(52.1098, 7.7107, 106.6024), powers),
        dot(vec3(-88.7519, 436.681, -264.5132), powers));
    float above = a * dot(vec3(0.0457, 0.2015, 0.142), powers) + c * (terms.x + c * (terms.y + c * terms.z));
    float steep = a * (123.225 * a - 36.7) + c * (16.5361 + 141.6331 * a);
    float below = a * a * a + c * (a * a * (58.4572 + 217.8073 * a) + c * steep);
    return clamp(a * a * above / below, 0.0, 1.0);
}
