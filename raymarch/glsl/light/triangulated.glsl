// Soft shadow (Aaltonen 2018): as light/cone, with the point of closest approach between two samples: the spheres of
// two steps intersect in a circle, on which the occluder is assumed to lie.
// A step is longer than its sphere where nothing comes nearer. It is kept if nothing reaches into the cone in question:
// the chords that the spheres of both samples cut from its side meet. Else a plain one replaces it, so all circles are
// those of plain steps. The first step is one from the start to `first`, as in light/clearance.
float triangulated_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    float first;
    Ray ray = shadow_ray(surface, light, range, first);
    range = scene_cone(ray, range, width);
    if (range.x >= range.y) return 1.0;
    width = min(width, 0.999);
    float near = 0.5 * contact(surface.p, surface.t);
    float least = 1.0;
    float t = range.x;
    float z = max(first - t, 0.0);
    float r = 0.25 * t;
    bool known = false;
    float derivative = 0.0;
#ifndef HALVED
    float slope = 1.0;
#ifdef AHEAD
    float way = 0.0;
#else
    const float way = 0.0;
#endif
#endif
    for (int i = 0; i < shadow_steps; i++) {
        float s = t + z;
#ifdef UNDIVIDED
        float d = u_side * undivided_field(ray.origin + s * ray.direction);
#else
#ifdef AHEAD
        vec2 found = free_ahead(ray, s, least * width);
        float d = found.x;
#else
        float d = u_side * field(ray.origin + s * ray.direction);
#endif
#endif
        if (d <= near + GROWTH * s) return 0.0;
#ifndef HALVED
        float sine = least * width;
        float cosine = sqrt(1.0 - sine * sine);
        float proven = half_chord(r, t, sine);
        float proven_here = half_chord(d, s, sine);
        bool longer = z > r;
        if (longer && max(proven, way * cosine) + proven_here < z * cosine) {
            slope = (proven_here - proven) / z;
            z = r;
            continue;
        }
        slope = clamp(min(known && z > 0.0 ? (proven_here - proven) / z : d / s, longer ? 1.0 : slope), -1.0, 0.99);
#else
        const bool longer = false;
#endif
        // If the circle lies before the last sample, the occluder is not between the two samples, but beyond both.
        float back = z > 0.0 && known && !longer ? 0.5 * (z + (d - r) * (d + r) / z) : 0.0;
        back = back > 0.0 && back < min(z, d) ? back : 0.0;
        float here = sqrt(d * d - back * back) / (width * (s - back));
#ifndef HALVED
        bool nears = here < least;
#endif
        least = min(least, here);
        if (known && z > 0.0) derivative = (d - r) / z;
        known = true;
        t = s;
        r = d;
#ifndef HALVED
#ifdef AHEAD
        way = found.y;
#endif
        z = max(r, way);
        if (!nears) z = max(z, 1.9 * half_chord(r, t, least * width) / max(cosine - slope, 0.01));
        if (t + max(r, way) >= range.y) return least;
        z = min(z, range.y - t);
#else
#ifdef UNDIVIDED
        z = safe_step(divided(r), t);
#else
        z = safe_step(r, t);
#endif
        if (t + z >= range.y) return least;
#endif
    }
    return meets_ahead(r, derivative, range.y - t) ? 0.0 : least;
}
