// A surface point that is to be lit, of materials with maps, and the light that comes to it from one source.
// needs: Ray Hit Material Relief surface_normal material_at relief_at inner_point u_side u_pixel footprint_pixels
// gives: Surface Light surface_interaction_mapped
struct Surface {
    vec3 p;
    vec3 normal;  // bent, on the side that is seen
    vec3 view;  // towards the eye
    float t;  // distance from the eye, along the ray
    Material material;
    float ambient_visibility;  // share of the ambient light that comes through
    vec3 geometric_normal;  // the normal of the solid
    vec3 dpdx;  // the axes of the ellipse that a pixel covers of the surface
    vec3 dpdy;
    vec3 inner;  // just inside the solid: where materials are asked
};

struct Light {
    vec3 direction;  // towards the source
    float distance;
    vec3 radiance;  // of a white matte surface that faces it; 0 where the source does not reach
};

// `travelled` is the way of the light from the surface to the eye: a pixel is as wide as that is long.
Surface surface_interaction_mapped(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 v = -ray.direction;
    float n_dot_v = dot(n, v);
    float width = footprint_pixels * u_pixel * travelled;
    vec3 dpdx = cross(n, v);
    float size = length(dpdx);
    // Seen from above, any direction along the surface will do.
    if (size < 1.0e-4) dpdx = abs(n.y) < 0.9 ? vec3(n.z, 0.0, -n.x) : vec3(0.0, -n.z, n.y);
    dpdx *= width / length(dpdx);
    vec3 dpdy = cross(n, dpdx) / max(abs(n_dot_v), 1.0e-4);
    vec3 inner = inner_point(p, n, hit, travelled);
    Relief relief = relief_at(inner, n, dpdx, dpdy);
    vec3 bent = normalize(n - relief.tilt);
    // What is bent away from the eye is not seen: it is lifted until it just is.
    float side = n_dot_v < 0.0 ? -1.0 : 1.0;
    bent = normalize(bent + side * max(0.01 - side * dot(bent, v), 0.0) * v);
    return Surface(p, u_side * bent, v, hit.t, material_at(inner, n, dpdx, dpdy), relief.open, n, dpdx, dpdy, inner);
}
