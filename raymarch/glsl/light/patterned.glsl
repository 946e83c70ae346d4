// A surface point that is to be lit, of materials with patterns, and the light that comes to it from one source.
// needs: Ray Hit Material surface_normal material_at inner_point u_side
// gives: Surface Light surface_interaction_patterned
struct Surface {
    vec3 p;
    vec3 normal;  // on the side that is seen
    vec3 view;  // towards the eye
    float t;  // distance from the eye, along the ray
    Material material;
    vec3 inner;  // just inside the solid: where materials are asked
};

struct Light {
    vec3 direction;  // towards the source
    float distance;
    vec3 radiance;  // of a white matte surface that faces it; 0 where the source does not reach
};

// `travelled` is the way of the light from the surface to the eye.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 inner = inner_point(p, n, hit, travelled);
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner), inner);
}
