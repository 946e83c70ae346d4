// Diffuse light of the sky on a Phong material: the cosine-weighted mean over the hemisphere.
vec3 diffuse_sky(Surface surface) {
    return surface.material.color * sky_mean(surface.normal);
}
