// Pass: the normal with which light shades each pixel, outward as that of the geometry; 0 where nothing was hit.
layout(location = 0) out vec4 out_shading_normal;

void main() {
    Ray ray = camera_ray(PIXEL);
    Hit hit = trace(ray);
    vec3 found = vec3(0.0);
    if (hit.found) {
        vec3 p = ray.origin + hit.t * ray.direction;
        vec3 n = surface_normal(p, ray.direction);
#ifdef RELIEF
        vec3 v = -ray.direction;
        float width = footprint_pixels * pixel_at(hit.t);
        vec3 dpdx = footprint_axis(n, v, width);
        vec3 dpdy = cross(n, dpdx) / max(abs(dot(n, v)), 1.0e-4);
        vec3 slope = relief_at(inner_point(p, n, hit, hit.t), n, dpdx, dpdy).bump_gradient;
        found = bent_normal(n, ray.direction, slope);
#else
        found = u_side * visible_side(u_side * n, ray.direction);
#endif
    }
    out_shading_normal = vec4(found, 0.0);
}
