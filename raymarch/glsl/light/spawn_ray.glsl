// A ray that starts two epsilons from a surface. The offset is along the ray, to keep shadows and refracted images in
// place; at grazing angles, where this would take more than four times the offset, the rest is along the normal.
Ray spawn_ray(vec3 p, vec3 normal, vec3 direction, float travelled, out float start) {
    float offset = 2.0 * epsilon(p, travelled);
    float rise = max(dot(normal, direction), 0.0);
    start = offset / max(rise, 0.25);
    return Ray(p + (offset - rise * start) * normal, direction);
}
