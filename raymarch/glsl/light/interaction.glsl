// The surface interaction of a hit at the end of a path of length `way`.
Surface surface_interaction(Ray ray, Hit hit, float way) {
    vec3 p = ray.origin + hit.t * ray.direction;
#ifdef JOINT
#ifdef PATTERNED
    float depth = inner_depth(p, hit, way);
    Part part = part_at(p, depth);
#else
    float depth = 0.0;
    Part part = part_at(p);
#endif
    vec3 n = facing_normal(part.gradient, ray.direction);
    return Surface(p, u_side * n, -ray.direction, hit.t, part.material, 1.0, n, vec3(0.0), vec3(0.0), p - depth * n);
#else
    vec3 n = surface_normal(p, ray.direction);
#ifdef MAPPED
    vec3 dpdx = footprint_axis(n, -ray.direction, footprint_pixels * pixel_at(way));
    vec3 dpdy = cross(n, dpdx) / max(abs(dot(n, ray.direction)), 1.0e-4);
    vec3 inner = inner_point(p, n, hit, way);
#ifdef RELIEF
    Relief relief = relief_at(inner, n, dpdx, dpdy);
    return Surface(p, u_side * bent_normal(n, ray.direction, relief.bump_gradient), -ray.direction, hit.t,
        material_at(inner, n, dpdx, dpdy), relief.ambient_visibility, n, dpdx, dpdy, inner);
#else
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner, n, dpdx, dpdy), 1.0, n, dpdx, dpdy, inner);
#endif
#else
#ifdef PATTERNED
    vec3 inner = inner_point(p, n, hit, way);
#else
    vec3 inner = p;
#endif
    return Surface(p, u_side * n, -ray.direction, hit.t, material_at(inner), 1.0, n, vec3(0.0), vec3(0.0), inner);
#endif
#endif
}
