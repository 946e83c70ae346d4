// Where a secondary ray meets a solid in closed form. Those are convex: the one that it starts from is behind it. In
// float32 the exit of that one is up to 13 ulp of the coordinates ahead where the ray rises by a cosine above 1/4, and
// its entry less than 1 ulp (tests/sdf/test_own_ends.py). So a solid that is entered 4 ulp ahead is another one, and
// one that is not left after 128 ulp holds the start.
float solved_ahead(Ray ray, float travelled) {
    float ulps = nearness(ray.origin, travelled, 0.0);  // 2
    return solved_hit(ray.origin, ray.direction, 2.0 * ulps, 64.0 * ulps);
}
