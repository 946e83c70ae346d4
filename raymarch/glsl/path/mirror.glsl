// The weight of mirror reflection in Whitted ray tracing, 1 up to a roughness of 0.1 and 0 from 0.2 on; and the
// reflectance after Schlick.
float mirror_weight(Material material) {
    return clamp(2.0 - 10.0 * material.roughness, 0.0, 1.0);
}

vec3 mirror_reflectance(Surface surface) {
    vec3 f0 = mix(surface.material.f0, surface.material.color, surface.material.metalness);
    return fresnel_schlick(f0, dot(surface.normal, surface.view));
}
