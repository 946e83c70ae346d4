// Hit thresholds: a fraction of the pixel width at the distance t, but no less than the resolution of float32. A point
// at distance t on a ray is as uncertain as the rounding of its coordinates and of t. A cone ends where its safe step
// falls to a fraction of its radius, and is not refined, because cones do not hit surfaces.
// needs: epsilon_pixels contact_share cone_share u_cone
// gives: u_pixel GROWTH nearness epsilon contact
uniform float u_pixel;  // width of a pixel at distance 1
const float GROWTH = 1.1920929e-7;  // growth of the coordinates' ulp per unit of length along a ray

float nearness(vec3 p, float t, float width) {
    vec3 size = abs(p);
    float ulps = 2.3841858e-7 * max(max(size.x, size.y), max(size.z, t));  // 2 ulp of the largest
    return max(width * t, ulps);
}

// Distance to a surface within which a ray refines its hit.
float epsilon(vec3 p, float t) {
#ifdef CONE
    return nearness(p, t, cone_share * u_cone);
#else
    return nearness(p, t, epsilon_pixels * u_pixel);
#endif
}

// Distance to a surface within which a ray has hit it.
float contact(vec3 p, float t) {
#ifdef CONE
    return epsilon(p, t);
#else
    return nearness(p, t, contact_share * epsilon_pixels * u_pixel);
#endif
}
