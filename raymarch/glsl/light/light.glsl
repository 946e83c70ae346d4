// The surface interaction of a hit, and a light sample.
// needs: Ray Hit Material surface_normal material_at u_side
// gives: Surface Light surface_interaction
struct Surface {
    vec3 p;
    vec3 normal;  // on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
};

struct Light {
    vec3 direction;  // towards the light
    float distance;
    vec3 radiance;  // reflected by a white diffuse surface that faces the light; 0 out of its range
};

Surface surface_interaction(Ray ray, Hit hit) {
    vec3 p = ray.origin + hit.t * ray.direction;
    return Surface(p, u_side * surface_normal(p, ray.direction), -ray.direction, hit.t, material_at(p));
}
