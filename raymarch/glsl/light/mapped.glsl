// The surface interaction of a hit, for materials with textures or relief, and a light sample.
// needs: Ray Hit Material Relief surface_normal material_at relief_at inner_point u_side u_pixel footprint_pixels
// gives: Surface Light surface_interaction_mapped
struct Surface {
    vec3 p;
    vec3 normal;  // shading normal, with normal mapping, on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
    float ambient_visibility;  // from the material's occlusion, 0 to 1
    vec3 geometric_normal;  // normal of the solid, without normal mapping
    vec3 dpdx;  // the pixel's footprint on the surface: axes of an ellipse
    vec3 dpdy;
    vec3 inner;  // just inside the solid, where materials are evaluated
};

struct Light {
    vec3 direction;  // towards the light
    float distance;
    vec3 radiance;  // reflected by a white diffuse surface that faces the light; 0 out of its range
};

// `travelled` is the length of the path from the camera to the surface. The pixel's footprint is proportional to it.
Surface surface_interaction_mapped(Ray ray, Hit hit, float travelled) {
    vec3 p = ray.origin + hit.t * ray.direction;
    vec3 n = surface_normal(p, ray.direction);
    vec3 v = -ray.direction;
    float n_dot_v = dot(n, v);
    float width = footprint_pixels * u_pixel * travelled;
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
