// The distance to a surface within which a ray always has hit it, at a point p at the end of a path of length t.
float contact(vec3 p, float t) {
    return nearness(p, t, contact_share * epsilon_pixels);
}
