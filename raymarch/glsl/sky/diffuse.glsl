// The sky's light on a surface after Phong: its mean over what a matte surface faces.
// needs: Surface sky_mean
// gives: diffuse_sky
vec3 diffuse_sky(Surface surface) {
    return surface.material.color * sky_mean(surface.normal);
}
