// The thresholds of the march of a ray: fractions of the pixel width, which grows with the distance t, but no less than
// the resolution of float32. A point on a ray is as uncertain as the rounding of its coordinates and of t. A cone ends
// where its safe step falls to a fraction of its radius, and is not refined, because cones do not hit surfaces.
#ifdef ORTHOGRAPHIC
uniform float u_pixel;  // width of a pixel, at all distances
#else
uniform float u_pixel;  // width of a pixel at distance 1
#endif
const float GROWTH = 1.1920929e-7;  // growth of the coordinates' ulp per unit of length along a ray

#ifdef ORTHOGRAPHIC
// Each threshold is linear in t: t times the first component plus the second for the distance to a surface within which
// a ray refines its hit, or plus the third for the distance within which it always has hit the surface.
#else
// Each threshold is linear in t: the first component plus t times the second for the distance to a surface within which
// a ray refines its hit, or plus t times the third for the distance within which it always has hit the surface.
#endif
vec3 hit_widths(Ray ray) {
    vec3 size = abs(ray.origin);
    float ulps = 2.0 * GROWTH;  // of 2 ulp of the largest coordinate
#ifdef CONE
#ifdef ORTHOGRAPHIC
    vec2 pixels = vec2(cone_share * u_cone_start);
#else
    vec2 pixels = vec2(cone_share * u_cone);
#endif
#else
    vec2 pixels = vec2(1.0, contact_share) * (epsilon_pixels * u_pixel);
#endif
#ifdef ORTHOGRAPHIC
    return vec3(ulps, pixels + ulps * max(size.x, max(size.y, size.z)));
#else
    return vec3(ulps * max(size.x, max(size.y, size.z)), pixels + ulps);
#endif
}
