// One point of a light's disc at random, for a hard shadow and an answer of its own: over many samples, what the whole disc
// does. `width` is the sine of its angular radius. Points are even on the disc that the light's ball makes on a plane
// across the way; each stands for a solid angle of 1 over the cosine, so that a matte surface gets what a point would give.
// needs: Light random_of_pixel
// gives: sample_disc
Light sample_disc(Light light, float width, int dimension) {
    vec3 d = light.direction;
    float s = d.z < 0.0 ? -1.0 : 1.0;  // the branchless basis of Duff et al. (2017)
    float a = -1.0 / (s + d.z);
    float b = d.x * d.y * a;
    vec3 across = vec3(1.0 + s * d.x * d.x * a, s * b, -s * d.x);
    vec3 along = vec3(b, s + d.y * d.y * a, -d.y);
    float r = min(width, 0.999) * sqrt(random_of_pixel(dimension));
    float turn = 6.2831853 * random_of_pixel(dimension + 1);
    float c = sqrt(1.0 - r * r);
    light.direction = c * d + r * (cos(turn) * across + sin(turn) * along);
    light.radiance /= c;
    return light;
}
