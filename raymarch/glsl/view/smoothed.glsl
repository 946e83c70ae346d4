// The colour of a pixel whose edges are smoothed by distance: its surfaces from front to back, see march/edges.
vec3 smoothed(vec2 pixel, out bool done) {
    Ray ray = camera_ray(pixel);
    vec2 range = range_of(ray);
    March at = first_of(ray, range);
    vec3 color = vec3(0.0);
    float rest = 1.0;
    done = true;
    for (int i = 0; i <= MOST_EDGES; i++) {
        Ray seen;
        Hit hit;
        float cover = next_surface(pixel, ray, at, range.y, i == MOST_EDGES, seen, hit);
        done = done && hit.done;
        if (cover > LEAST_SHARE) {
            color += rest * cover * shade(seen, hit);
            rest *= 1.0 - cover;
        }
        if (rest < LEAST_SHARE) break;
    }
    return color / (1.0 - rest);
}
