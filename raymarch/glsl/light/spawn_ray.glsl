// The ray that leaves a surface, from two epsilons off it. It begins that far along its own line, lest shadows and what
// is seen through glass be shifted; only where that would be more than four times as far, along the normal too.
// needs: Ray epsilon
// gives: spawn_ray
Ray spawn_ray(vec3 p, vec3 normal, vec3 direction, float travelled, out float start) {
    float offset = 2.0 * epsilon(p, travelled);
    float rise = max(dot(normal, direction), 0.0);
    start = offset / max(rise, 0.25);
    return Ray(p + (offset - rise * start) * normal, direction);
}
