// The surface interaction of a hit, for materials that depend on the point, and a light sample.
// needs: Ray Hit Material Part facing_normal part_at inner_depth u_side
// gives: Surface Light surface_interaction_patterned
struct Surface {
    vec3 p;
    vec3 normal;  // on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
    vec3 inner;  // just inside the solid, where materials are evaluated
};

struct Light {
    vec3 direction;  // towards the light
    float distance;
    vec3 radiance;  // reflected by a white diffuse surface that faces the light; 0 out of its range
};

// `travelled` is the length of the path from the camera to the surface.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    float depth = inner_depth(p, hit, travelled);
    Part part = part_at(p, depth);
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material, p - depth * n);
}
