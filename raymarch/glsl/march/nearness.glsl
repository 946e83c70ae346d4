// A fraction of the pixel width at the point p, a path of length t away; at least the resolution of float32 there.
float nearness(vec3 p, float t, float pixels) {
    vec3 size = abs(p);
    float ulps = 2.0 * GROWTH * max(max(size.x, size.y), max(size.z, t));  // 2 ulp of the largest
#ifdef BOUNCES
    pixels *= secondary_pixel();
#else
    pixels *= u_pixel;
#endif
#ifdef ORTHOGRAPHIC
    return max(pixels, ulps);
#else
    return max(pixels * t, ulps);
#endif
}
