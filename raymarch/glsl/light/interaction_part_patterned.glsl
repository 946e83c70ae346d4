// The surface interaction of a hit, from the part just inside the solid. `travelled`: path length so far.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    float depth = inner_depth(p, hit, travelled);
    Part part = part_at(p, depth);
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material, p - depth * n);
}
