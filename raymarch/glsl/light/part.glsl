// The surface interaction of a hit, and a light sample.
// needs: Ray Hit Material Part facing_normal part_at u_side
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
    Part part = part_at(p);
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material);
}
