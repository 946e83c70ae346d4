// Fog between the camera and a surface: transmittance exp(-density t).
vec3 apply_fog(vec3 color, float t) {
    return mix(fog_color(), color, exp(-fog_density() * t));
}
