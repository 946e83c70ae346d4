// Energy that single scattering by white microfacets loses at a cosine: 1 minus their directional albedo. A fit to the
// integral of GGX with correlated masking, between 0.008 below and 0.005 above.
float missing_albedo(float cosine, float roughness) {
    float a = max(roughness * roughness, 1.0e-6);
    float c = clamp(cosine, 1.0e-4, 1.0);
    vec3 powers = vec3(1.0, a, a * a);
    vec3 terms = vec3(dot(vec3(0.2448, -0.0067, 3.9077), powers), dot(vec3(1.3351, -0.281, 2.9461), powers),
        dot(vec3(-1.9867, 10.9215, -6.6435), powers));
    float above = c * (terms.x + c * (terms.y + c * terms.z));
    float steep = a * (1.5333 * a - 0.6629) + c * (0.588 + 3.8876 * a);
    float below = a * a * a + c * (a * a * (1.3633 + 7.3622 * a) + c * steep);
    return clamp(a * a * above / below, 0.0, 1.0);
}
