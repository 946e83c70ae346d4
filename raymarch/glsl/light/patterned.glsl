// The surface interaction of a hit, for materials that depend on the point, and a light sample.
// needs: Ray Hit Material surface_normal material_at inner_point u_side
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
    vec3 n = surface_normal(p, ray.direction);
    vec3 inner = inner_point(p, n, hit, travelled);
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner), inner);
}
