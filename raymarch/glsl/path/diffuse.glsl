// Samples a direction of the diffuse part of a Phong material. Returns false if there is none.
bool sample_diffuse(Surface surface, int dimension, out vec3 direction, inout vec3 weight) {
    direction = sample_cosine(surface.normal, vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2)));
    weight *= surface.material.color;
    return true;
}
