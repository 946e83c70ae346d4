// One random point on a light's disc, for a hard shadow and BSDF evaluation of its own. The mean over many samples
// converges to the whole disc. `width` is the sine of the angular radius. Points are uniform on the projection of the
// light's sphere to a plane perpendicular to the light's direction. Each is weighted by 1 / cosine for its solid angle,
// so that a diffuse surface is as bright as under a point light.
Light sample_disc(Light light, float width, int dimension) {
    vec3 d = light.direction;
    float s = d.z < 0.0 ? -1.0 : 1.0;  // branchless orthonormal basis (Duff et al. 2017)
    float a = -1.0 / (s + d.z);
    float b = d.x * d.y * a;
    vec3 tangent = vec3(1.0 + s * d.x * d.x * a, s * b, -s * d.x);
    vec3 bitangent = vec3(b, s + d.y * d.y * a, -d.y);
    float r = min(width, 0.999) * sqrt(random_of_pixel(dimension));
    float turn = 6.2831853 * random_of_pixel(dimension + 1);
    float c = sqrt(1.0 - r * r);
    light.direction = c * d + r * (cos(turn) * tangent + sin(turn) * bitangent);
    light.radiance /= c;
    return light;
}
