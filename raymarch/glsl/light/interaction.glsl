// Makes the surface interaction of a hit: the normal, then the material.
Surface surface_interaction(Ray ray, Hit hit) {
    vec3 p = ray.origin + hit.t * ray.direction;
    return Surface(p, u_side * surface_normal(p, ray.direction), -ray.direction, hit.t, material_at(p));
}
