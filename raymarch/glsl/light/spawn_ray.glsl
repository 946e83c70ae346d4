// How far from a surface the rays of shadows and bounces start.
float spawn_offset(vec3 p, float travelled) {
    return 2.0 * epsilon(p, travelled);
}

// A ray that starts two epsilons from a surface. The offset is along the ray, to keep shadows and refracted images in
// place; at grazing angles, where this would take more than four times the offset, the rest is along the normal. Below
// 30 degrees its first sample, at `start`, is farther: as far from the surface as from the offset, so that it proves
// all of the ray but the offset empty.
Ray spawn_ray(vec3 p, vec3 normal, vec3 direction, float travelled, out float start) {
    float offset = spawn_offset(p, travelled);
    float rise = max(dot(normal, direction), 0.0);
    float lift = max(1.0 - 4.0 * rise, 0.0);
    start = rise < 0.5 ? offset * (1.0 + lift) / (1.0 - rise) : offset / rise;
    return Ray(p + offset * lift * normal, direction);
}
