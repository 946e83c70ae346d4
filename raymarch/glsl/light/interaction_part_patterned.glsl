// Makes the surface interaction of a hit from the part that it lies on, which is evaluated just inside the solid.
// `travelled` is the length of the path from the camera to the surface.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    float depth = inner_depth(p, hit, travelled);
    Part part = part_at(p, depth);
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material, p - depth * n);
}
