// Makes the surface interaction of a hit: the normal, then the material just inside the solid.
// `travelled` is the length of the path from the camera to the surface.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 inner = inner_point(p, n, hit, travelled);
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner), inner);
}
