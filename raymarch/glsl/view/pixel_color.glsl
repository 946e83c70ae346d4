// The linear colour of a pixel. Alpha is 0 where its ray ran out of steps, else 1.
#ifdef EDGES
// Edges are smoothed by distance: the surfaces of the pixel from front to back, see march/edges.
#endif
vec4 pixel_color(vec2 pixel) {
    Ray ray = camera_ray(pixel);
#ifdef EDGES
    vec2 range = range_of(ray);
    March at = first_of(ray, range);
    vec3 color = vec3(0.0);
    float rest = 1.0;
    bool done = true;
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
    return vec4(color / (1.0 - rest), done ? 1.0 : 0.0);
#else
    Hit hit = trace(ray);
    return vec4(shade(ray, hit), hit.done ? 1.0 : 0.0);
#endif
}
