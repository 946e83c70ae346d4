// Where the light that a surface after Phong sends to the eye came from: one direction of the matte part. False if none.
// needs: Surface cosine_lobe random_of_pixel
// gives: from_matte
bool from_matte(Surface surface, int dimension, out vec3 direction, inout vec3 weight) {
    direction = cosine_lobe(surface.normal, vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2)));
    weight *= surface.material.color;
    return true;
}
