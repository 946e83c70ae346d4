// The surface interaction of a hit: normal, footprint, relief, and the material just inside the solid. `travelled`:
// length of the path from the camera, to which the pixel's footprint is proportional.
Surface surface_interaction_mapped(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 v = -ray.direction;
#ifdef ORTHOGRAPHIC
    float width = footprint_pixels * u_pixel;
#else
    float width = footprint_pixels * u_pixel * travelled;
#endif
    vec3 dpdx = footprint_axis(n, v, width);
    vec3 dpdy = cross(n, dpdx) / max(abs(dot(n, v)), 1.0e-4);
    vec3 inner = inner_point(p, n, hit, travelled);
    Material material = material_at(inner, n, dpdx, dpdy);
#ifdef RELIEF
    Relief relief = relief_at(inner, n, dpdx, dpdy);
    vec3 normal = bent_normal(n, ray.direction, relief.bump_gradient);
    return Surface(p, u_side * normal, v, hit.t, material, relief.ambient_visibility, n, dpdx, dpdy, inner);
#else
    return Surface(p, u_side * n, v, hit.t, material, 1.0, n, dpdx, dpdy, inner);
#endif
}
