// Pass: the hit of each pixel and its cost. Where nothing was hit, depth is -1 and the residual 0.
layout(location = 0) out vec4 out_march;  // depth along the ray, residual, iterations, evaluations
layout(location = 1) out vec4 out_surface;  // normal, index of the material
layout(location = 2) out vec4 out_more;  // fallbacks, 1 if the march did not run out of steps, its last distance

void main() {
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    out_march = vec4(-1.0, 0.0, hit.iterations, hit.evaluations);
#ifdef EDGES
    out_march.w = evaluations_with_edges(PIXEL);
#endif
    out_surface = vec4(0.0, 0.0, 0.0, -1.0);
    out_more = vec4(hit.fallbacks, hit.done ? 1.0 : 0.0, hit.t, 0.0);
    if (hit.found) {
        out_march.xy = vec2(hit.t, hit.residual);
        vec3 p = ray.origin + hit.t * ray.direction;
        vec3 normal = u_side * visible_side(u_side * surface_normal(p, ray.direction), ray.direction);
        out_surface = vec4(normal, material_index(p));
    }
}
