// How near is near enough: a share of the pixel's width at that distance, but never less than float32 can tell apart.
// A point at distance t on a ray is as uncertain as the rounding of its coordinates and of t.
// needs: epsilon_pixels contact_share
// gives: u_pixel GROWTH nearness epsilon contact
uniform float u_pixel;  // width of a pixel at distance 1
const float GROWTH = 1.1920929e-7;  // of an ulp of a point's coordinates along a ray

float nearness(vec3 p, float t, float pixels) {
    vec3 size = abs(p);
    float ulps = 2.3841858e-7 * max(max(size.x, size.y), max(size.z, t));  // 2 ulp of the largest
    return max(pixels * u_pixel * t, ulps);
}

// Within this of a surface, a ray looks for the point where it meets it.
float epsilon(vec3 p, float t) {
    return nearness(p, t, epsilon_pixels);
}

// Within this it has met it.
float contact(vec3 p, float t) {
    return nearness(p, t, contact_share * epsilon_pixels);
}
