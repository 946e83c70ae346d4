// A surface point that is to be lit, and the light that comes to it from one source.
// needs: Ray Hit Material surface_normal material_at u_side
// gives: Surface Light surface_interaction
struct Surface {
    vec3 p;
    vec3 normal;  // on the side that is seen
    vec3 view;  // towards the eye
    float t;  // distance from the eye, along the ray
    Material material;
};

struct Light {
    vec3 direction;  // towards the source
    float distance;
    vec3 radiance;  // of a white matte surface that faces it; 0 where the source does not reach
};

Surface surface_interaction(Ray ray, Hit hit) {
    vec3 p = ray.origin + hit.t * ray.direction;
    return Surface(p, u_side * surface_normal(p, ray.direction), -ray.direction, hit.t, material_at(p));
}
