// The thresholds of a march: fractions of the pixel width, which grows with t, but at least the resolution of float32.
#ifdef CONES
// A cone ends where its safe step falls to a fraction of its radius, and is not refined.
#endif
#ifdef ORTHOGRAPHIC
uniform float u_pixel;  // width of a pixel, at all distances
#else
uniform float u_pixel;  // width of a pixel at distance 1
#endif

// The width of a pixel at t along a ray.
float pixel_at(float t) {
#ifdef ORTHOGRAPHIC
    return u_pixel;
#else
    return u_pixel * t;
#endif
}

const float GROWTH = 1.1920929e-7;  // growth of the coordinates' ulp per unit of length along a ray
#ifdef BOUNCES

// The pixel that sets how near rays end at a surface and start from it in scenes with bounces. It is at most 1/300 of
// the path, or of twice the diagonal of the solids where that is shorter: the brightness of a room must depend neither
// on the size of the picture nor on the distance of the camera.
float secondary_pixel() {
#ifdef ORTHOGRAPHIC
    return min(u_pixel, 0.0033 * path_extent);
#else
    return min(u_pixel, 0.0033 * min(path_extent / u_far, 1.0));
#endif
}
#endif

#ifdef ORTHOGRAPHIC
// Linear in t, as (x t + y) for the width at which a ray refines its hit and (x t + z) for that at which it has one.
#else
// Linear in t, as (x + y t) for the width at which a ray refines its hit and (x + z t) for that at which it has one.
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
#ifdef BOUNCES
    pixels *= secondary_pixel() / u_pixel;
#endif
#ifdef EDGES
    if (edge_width > 0.0) pixels = vec2(cone_share * edge_width);
#endif
#endif
#ifdef ORTHOGRAPHIC
    return vec3(ulps, pixels + ulps * max(size.x, max(size.y, size.z)));
#else
    return vec3(ulps * max(size.x, max(size.y, size.z)), pixels + ulps);
#endif
}

// One of these widths at t along a ray.
float width_at(vec3 widths, float width, float t) {
#ifdef ORTHOGRAPHIC
    return widths.x * t + width;
#else
    return widths.x + width * t;
#endif
}
