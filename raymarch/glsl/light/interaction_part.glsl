// Makes the surface interaction of a hit from the part that it lies on.
Surface surface_interaction(Ray ray, Hit hit) {
    vec3 p = ray.origin + hit.t * ray.direction;
    Part part = part_at(p);
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material);
}
