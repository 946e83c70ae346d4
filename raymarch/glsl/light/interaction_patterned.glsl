// The surface interaction of a hit: normal, then material just inside the solid. `travelled`: path length so far.
Surface surface_interaction_patterned(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 inner = inner_point(p, n, hit, travelled);
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner), inner);
}
