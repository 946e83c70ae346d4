// The march of soft shadows: the least clearance of a ray, as a fraction of the radius of a cone around it, at most
// 1. `width` is the sine of the cone's half angle, below 1. The clearance is 0 or less where the ray meets a solid:
// minus the depth that it reaches there, at least -1, if `deep` is true, else 0.
// Steps are accelerated as those of hard shadows: the next sphere is expected to meet this one, by the slope of the
// field. The part of the cone that is still in question is free between two spheres if their chords of its side meet. A
// step for which they do not is undone, and replaced by one that this sphere proves alone. So the clearance is known to
// 1/16. A step is 5 % short of where the chords would touch, because one that is undone costs more than a short one.
#ifdef AHEAD
// Where solids tell how far a ray is free, they tell it of that part of the cone: `way`. The first ray of several asks
// about the whole cone, because `range` is its result too.
#endif
// Fields without proof of their spheres take half of the distance, or as long a step as holds nothing that would
// count, by the steepest slope of the field or by how far the cone is free.
// The first sample lies at `first`. Where it does not prove the way from the start on free, but for a quarter of the
// start, the ray goes back.
// A ray that runs out of steps is extrapolated to its end. `range` becomes the part in which anything may reach into
// the cone.
float clearance(Ray ray, inout vec2 range, float first, float near, float width, bool deep) {
    float least = 1.0;
    float t = range.x;
    float z = max(first - t, 0.0);
    float r = 0.25 * t;
#ifndef HALVED
    // between samples: along a step that was undone, at most 1; else 2
    float slope = 2.0;
#endif
#ifdef AHEAD
    float way = 0.0;
#else
    const float way = 0.0;
#endif
    float rise = 0.0;
    // below 0 before the ray has met a solid
    float depth = -1.0;
    float end = range.y;
    for (int i = 0; i < shadow_steps; i++) {
        float s = t + z;
#ifdef AHEAD
#ifdef STRETCH
        begin_stretch(i == 0 ? end - t : max(8.0 * z, s));
#endif
        vec2 found = free_ahead(ray, s, (deep ? 1.0 : 0.9375 * least) * width);
        float d = found.x;
#else
#ifdef UNDIVIDED
        float d = u_side * undivided_field(ray.origin + s * ray.direction);
#else
        float d = u_side * field(ray.origin + s * ray.direction);
#endif
#endif
        float radius = width * s;
        bool met = depth >= 0.0;
#ifndef HALVED
        bool undone = slope < 2.0;
        bool leapt = z > max(r, way) + abs(d) && !undone;
        bool inside = met || (d <= max(near + GROWTH * s, 0.02 * radius) && !(leapt && deep));
#else
        bool inside = met || d <= max(near + GROWTH * s, 0.02 * radius);
#endif
        if (inside) {
            depth = max(max(depth, 0.0), -d / radius);
            t = s;
            z = min(max(abs(d), 0.25 * radius), end - t);
            if (!deep || depth >= 1.0 || (met && d > 0.0) || t >= end) break;
            range.y = end;
            continue;
        }
#ifndef HALVED
        bool known = i > int(undone) && z > 0.0;
        float least_here = leapt ? least : min(least, d / radius);
        float sine = 0.9375 * least_here * width;
        float proven = half_chord(r, t, sine);
        float proven_here = half_chord(d, s, sine);
        float cosine = sqrt(1.0 - sine * sine);
        if (!undone && max(proven, way * cosine) + proven_here < z * cosine) {
            least = least_here;
            slope = min((proven_here - proven) / z, 1.0);
            z = max(proven / cosine, way);
            continue;
        }
        slope = clamp(known ? min((proven_here - proven) / z, slope) : d / s, -1.0, 0.99);
        bool clear = d >= radius && half_chord(r, t, width) + half_chord(d, s, width) >= z * sqrt(1.0 - width * width);
#ifdef AHEAD
        clear = clear || (d >= radius && deep && z <= way);
        way = found.y;
#endif
#else
        bool known = i > 0 && z > 0.0;
        float least_here = min(least, d / radius);
#ifdef AHEAD
        bool clear = d >= 2.0 * radius || (d >= radius && deep && z <= way);
        way = found.y;
#else
        bool clear = d >= 2.0 * radius;
#endif
#endif
        if (known) rise = (d - r) / z;
        least = least_here;
        t = s;
        r = d;
        if (least >= 1.0) range.x = t;
        range.y = clear ? min(range.y, t) : end;
#ifndef HALVED
        sine = 0.9375 * least * width;
        cosine = sqrt(1.0 - sine * sine);
        proven = half_chord(r, t, sine);
        if (t + max(proven / cosine, way) >= end) {
            // nothing lies ahead
            r = 1.0e30;
            break;
        }
        z = way > 1.02 * proven / cosine ? way : max(1.9 * proven / max(cosine - slope, 0.01), -slope * r);
        z = min(z, end - t);
        slope = 2.0;
#else
#ifdef UNDIVIDED
#ifdef ESTIMATE
        z = safe_step(0.5 * divided(r), t);
#else
        z = safe_step(max(0.5 * divided(r), divided(r - (deep ? radius : least * radius)) / (1.0 + width)), t);
#endif
#else
        z = safe_step(0.5 * r, t);
#endif
        z = max(z, way);
        if (t + z >= end) {
            // nothing lies ahead
            r = 1.0e30;
            break;
        }
#endif
    }
    return depth >= 0.0 ? -min(depth, 1.0) : max(min(least, (r + rise * (end - t)) / (width * end)), 0.0);
}
