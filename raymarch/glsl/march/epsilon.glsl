// The distance to a surface within which a ray refines its hit, at a point p at the end of a path of length t.
float epsilon(vec3 p, float t) {
    return nearness(p, t, epsilon_pixels);
}
