// The ray from a surface to the point of a light, its range, and where its first sample lies. It starts as `spawn_ray`
// does, aims at the point from there, and ends 128 ulp of the coordinates before it, so that it does not meet what
// touches the light.
Ray shadow_ray(Surface surface, Light light, out vec2 range, out float first) {
    Ray ray = spawn_ray(surface.p, geometric_normal(surface), light.direction, surface.t, first);
    vec3 to_light = light.distance * light.direction + (surface.p - ray.origin);
    float distance = max(length(to_light), 1.0e-30);
    ray.direction = to_light / distance;
    range = vec2(min(spawn_offset(surface.p, surface.t), first), distance - 64.0 * nearness(surface.p, distance, 0.0));
    return ray;
}
