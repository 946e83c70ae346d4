// Makes the surface interaction of a hit: the normal, the footprint, the relief, and the material just inside the solid.
// `travelled` is the length of the path from the camera to the surface. The pixel's footprint is proportional to it.
Surface surface_interaction_mapped(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 v = -ray.direction;
    float n_dot_v = dot(n, v);
#ifdef ORTHOGRAPHIC
    float width = footprint_pixels * u_pixel;
#else
    float width = footprint_pixels * u_pixel * travelled;
#endif
    vec3 dpdx = cross(n, v);
    float size = length(dpdx);
    // At normal incidence the footprint is a circle: any tangent will do.
    if (size < 1.0e-4) dpdx = abs(n.y) < 0.9 ? vec3(n.z, 0.0, -n.x) : vec3(0.0, -n.z, n.y);
    dpdx *= width / length(dpdx);
    vec3 dpdy = cross(n, dpdx) / max(abs(n_dot_v), 1.0e-4);
    vec3 inner = inner_point(p, n, hit, travelled);
    Relief relief = relief_at(inner, n, dpdx, dpdy);
    vec3 shading_normal = normalize(n - relief.bump_gradient);
    // A shading normal that faces away from the camera is turned until it just faces the camera.
    float side = n_dot_v < 0.0 ? -1.0 : 1.0;
    shading_normal = normalize(shading_normal + side * max(0.01 - side * dot(shading_normal, v), 0.0) * v);
    return Surface(p, u_side * shading_normal, v, hit.t, material_at(inner, n, dpdx, dpdy), relief.ambient_visibility, n, dpdx, dpdy, inner);
}
