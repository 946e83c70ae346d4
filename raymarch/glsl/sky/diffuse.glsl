// Diffuse light of the sky on a Phong material: the cosine-weighted mean over the hemisphere.
// needs: Surface sky_mean
// gives: diffuse_sky
vec3 diffuse_sky(Surface surface) {
    return surface.material.color * sky_mean(surface.normal);
}
