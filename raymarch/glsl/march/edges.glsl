// The surfaces that share a pixel, from front to back: silhouettes that its ray passes or just hits, then what lies
// behind. The surface is moved outwards by half the diagonal of a pixel, so that each silhouette in the pixel is met.
// From there the ray is followed to the least distance, beside the solid or inside of it. Distances on both sides then
// tell how much of the pixel the solid covers: the area on one side of a straight edge, or between two.
const int MOST_EDGES = 4;  // silhouettes that one ray may pass; the next surface covers the rest of the pixel
const float LEAST_SHARE = 0.002;  // of a pixel, less is left out
const int EDGE_STEPS = 24;  // most samples beside one silhouette

// The stretch of a ray near a surface. `entry` is the last sample before the solid, and `first` the next one.
struct Chord {
    vec2 least;  // distance along the ray, and the field there
    vec2 entry;
    vec2 first;
    float slope;  // of the field from there on
    float end;
    bool inside;
    bool deep;  // the solid covers the whole pixel
};

float edge_evaluations = 0.0;

float edge_reach(float t) {
    return EDGE_REACH * pixel_at(t);
}

float edge_distance(Ray ray, float t) {
    edge_evaluations += 1.0;
    vec3 p = ray.origin + t * ray.direction;
#ifdef ANALYTIC
    return u_side * ray_field(p, u_side < 0.0);
#else
    return u_side * field(p);
#endif
}

// The field beside a point of a pixel's ray, at the same depth; `offset` in pixels.
float beside(vec2 pixel, Ray ray, float t, vec2 offset) {
    Ray other = camera_ray(pixel + offset);
    float rate = dot(ray.direction, u_camera_frame[2]) / dot(other.direction, u_camera_frame[2]);
    return edge_distance(other, t * rate);
}

// The field in pixels, except for a constant factor.
float edge_ratio(vec2 at) {
    return at.y / edge_reach(at.x);
}

// Finds the least of three samples in a row, by parabolas.
vec2 least_between(Ray ray, vec2 a, vec2 b, vec2 c) {
    for (int i = 0; i < 6; i++) {
        if (b.x <= a.x || c.x <= b.x) return b;
        float middle = edge_ratio(b);
        float before = (edge_ratio(a) - middle) / (b.x - a.x);
        float after = (edge_ratio(c) - middle) / (c.x - b.x);
        float bend = (before + after) / (c.x - a.x);
        float move = 0.5 * (before * (c.x - b.x) - after * (b.x - a.x)) / max((before + after), 1.0e-20);
        if (bend * move * move < 0.005 && max(b.x - a.x, c.x - b.x) * max(before, after) < 0.06) return b;
        if ((i & 1) == 1) {  // where lines of the steeper slope meet, as beside a thin sheet
            move = 0.5 * (c.x + a.x + (edge_ratio(a) - edge_ratio(c)) / max(before, after)) - b.x;
        }
        float side = c.x - b.x > b.x - a.x ? c.x - b.x : a.x - b.x;
        bool small = abs(move) < 0.1 * abs(side);
        float t = b.x + (small ? 0.25 * side : move);  // at most half of a side, as b is the least
        vec2 found = vec2(t, edge_distance(ray, t));
        bool lower = edge_ratio(found) < middle;
        if (t < b.x) {
            if (lower) c = b; else a = found;
        } else {
            if (lower) a = b; else c = found;
        }
        if (lower) b = found;
    }
    return b;
}

// Follows a ray from a point near a surface, until it is deep inside of the solid or has passed it.
Chord chord_from(Ray ray, float t, float r, float slope, float far) {
    vec2 last = vec2(t, r);
    vec2 a = last;
    vec2 b = last;
    vec2 c = last;
    Chord found = Chord(last, last, last, slope, far, false, false);
    float reach = edge_reach(t);
    float z = slope < -0.1 ? (r + 1.05 * reach) / -slope : 1.5 * reach;
    for (int i = 0; i < EDGE_STEPS; i++) {
        vec2 next;
        next.x = min(last.x + z, far);
        next.y = edge_distance(ray, next.x);
        float taken = next.x - last.x;
        reach = edge_reach(next.x);
        float off = abs(next.y - last.y - slope * taken) / reach;
        if (off > 1.0 && taken > 2.0 * reach && (next.y > 0.0 || taken > abs(last.y) - next.y + reach)) {
            z = 0.3 * taken;
            continue;
        }
        if (last.y > 0.0 && c.x > b.x && next.y < last.y - 0.05 * reach) {  // towards another surface
            if (edge_ratio(b) < 1.0) break;
            b = last;
        }
        if (taken > 0.0) slope = (next.y - last.y) / taken;
        if (edge_ratio(next) < edge_ratio(b)) {
            a = last;
            b = next;
            c = next;
        } else if (c.x == b.x) {
            c = next;
        }
        if (next.y <= 0.0 && !found.inside) {
            found.inside = true;
            found.entry = last;
            found.first = next;
            found.slope = slope;
        }
        last = next;
        found.end = next.x;
        found.deep = next.y < -1.02 * reach;
        bool passed = next.y > 1.3 * reach && slope > 0.0;
        if (found.deep || passed || next.x >= far) break;
        z = taken * (off < 0.1 ? 2.0 : off < 0.3 ? 1.0 : 0.5);
        float goal = slope < 0.0 ? (next.y + 1.05 * reach) / -slope : (1.4 * reach - next.y) / max(slope, 1.0e-6);
        z = max(min(z, goal), 0.25 * reach);
    }
    if (found.deep) return found;
    found.least = least_between(ray, a, b, c);
    if (!found.inside && found.least.y < 0.0) {
        found.inside = true;
        found.entry = a;
        found.first = found.least;
    }
    for (int i = 0; found.inside && i < 5; i++) {
        float middle = 0.5 * (found.entry.x + found.first.x);
        vec2 next = vec2(middle, edge_distance(ray, middle));
        found.slope = (found.first.y - found.entry.y) / max(found.first.x - found.entry.x, 1.0e-20);
        if (next.y > 0.0) found.entry = next; else found.first = next;
    }
    return found;
}

// The area of a pixel on one side of a straight edge, at a distance of `offset` pixels beyond its centre.
float area_before(float offset, vec2 normal) {
    vec2 n = abs(normal);
    float wide = max(n.x, n.y);
    float narrow = min(n.x, n.y);
    float away = abs(offset);
    float rest = max(0.5 * (wide + narrow) - away, 0.0);
    float beyond = away < 0.5 * (wide - narrow) ? 0.5 - away / wide : 0.5 * rest * rest / max(wide * narrow, 1.0e-6);
    return offset > 0.0 ? 1.0 - beyond : beyond;
}

// A number of turns that compilers do not know, so that the field is in the text of a loop once: it may be long.
int turns(int count) {
    return u_pixel > 0.0 ? count : 0;
}

// The least field along a ray beside that of a pixel, near a point: of a parabola, or where a line falls to 0.
float least_beside(vec2 pixel, Ray ray, float t, vec2 offset, float width) {
    float middle = 0.0;
    float after = 0.0;
    float found = 0.0;
    float move = 0.0;
    for (int i = 0; i < turns(4); i++) {
        float r = beside(pixel, ray, t + move, offset);
        if (i == 0) {
            middle = r;
            move = 0.5 * width;
        } else if (i == 1) {
            after = r;
            move = -0.5 * width;
        } else if (i == 2) {
            found = min(middle, min(r, after));
            float bend = r + after - 2.0 * middle;
            float rise = after - r;
            if (bend > 0.01 * width && abs(rise) < 3.0 * bend) found = min(found, middle - rise * rise / (8.0 * bend));
            float fall = max(r, after) - middle;
            if (fall < 0.1 * width) break;
            move = (r > after ? 1.0 : -1.0) * min(0.5 * middle / fall, 4.0) * width;
        } else {
            found = r < 0.03 * width ? -width : min(found, r);  // a sheet goes on
        }
    }
    return found;
}

// How much of a pixel the solid covers that its ray passes or enters. `offset` is the middle of that part, in pixels.
float covered(vec2 pixel, Ray ray, Chord chord, out vec2 offset) {
    float t = chord.least.x;
    float width = edge_reach(t) / EDGE_REACH;
    vec2 rise = vec2(0.0);
    for (int i = 0; i < turns(4); i++) {
        vec2 way = i < 2 ? vec2(1 - 2 * i, 0.0) : vec2(0.0, 5 - 2 * i);
        rise += 5.0 * way * beside(pixel, ray, t, 0.1 * way);
    }
    float rate = length(rise);
    offset = vec2(0.0);
    if (rate < 0.05 * width && !chord.inside) return 0.0;
    vec2 normal = rate < 1.0e-3 * width ? vec2(1.0, 0.0) : rise / rate;
    vec2 away = 0.5 * normal;
    float outer = 0.0;
    float inner = 0.0;
    for (int i = 0; i < turns(2); i++) {
        float least = least_beside(pixel, ray, t, i == 0 ? away : -normal, width);
        if (i == 0) outer = least; else inner = least;
    }
    rate = max(2.0 * (outer - chord.least.y), 0.1 * width);
    vec2 ends = vec2(chord.inside ? 0.5 - outer / rate : -chord.least.y / rate, 1.0 - inner / rate);
    if (chord.inside && chord.slope < -0.1) {  // the ray goes through a face: an edge of it, or a thin solid
        float start = chord.entry.x - chord.entry.y / chord.slope;
        float across = 0.0;
        for (int i = 0; i < turns(3); i++) {
            float r = beside(pixel, ray, start, i == 0 ? away : i == 1 ? 0.2 * away : -0.2 * away);
            if (i == 0) outer = min(outer, r); else across += i == 1 ? 5.0 * r : -5.0 * r;
        }
        ends = vec2(0.5, 1.0) - vec2(outer, inner) / length(vec2(chord.slope * width, across));
    }
    if (chord.inside) ends = max(ends, 0.0);
    vec2 kept = clamp(ends, -0.5, 0.5);
    offset = 0.5 * (kept.x - kept.y) * normal;
    return clamp(area_before(ends.x, normal) + area_before(ends.y, normal) - 1.0, 0.0, 1.0);
}

#ifdef ANALYTIC
bool above_horizon = false;  // what is left of the pixel is the sky

float solved_end(Ray ray) {
    vec2 range = scene_range(ray);
    float t = solved_hit(ray.origin, ray.direction, range.x, range.x);
    return t > range.y ? 1.0e30 : t;
}

// How much of a pixel a plane covers that ends at the horizon: a share of 16 rays, without any evaluation.
float horizon(vec2 pixel, inout March at, inout Ray seen, inout Hit hit) {
    if (above_horizon) hit.found = false;
    vec2 sum = vec2(0.0);
    float count = 0.0;
    for (int i = 0; i < 20 && !above_horizon; i++) {
        if (i == 4) {
            if (count == 0.0 || count == 4.0) return 1.0;
            count = 0.0;
        }
        vec2 place = i < 4 ? vec2(i & 1, i >> 1) - 0.5 : (vec2(i & 3, (i - 4) >> 2) - 1.5) * 0.25;
        if (solved_end(camera_ray(pixel + place)) >= 1.0e30) continue;
        count += 1.0;
        if (i >= 4) sum += place;
    }
    if (above_horizon || count == 0.0 || count == 16.0) return 1.0;
    above_horizon = true;
    at.t = 2.0e30;
    seen = camera_ray(pixel + sum / count);
    hit.t = solved_end(seen);
    hit.found = hit.t < 1.0e30;
    return count / 16.0;
}

#endif
// Marches to the next surface in a pixel, and returns how much of the pixel it covers. `seen` is the ray through the
// middle of that part. The last one covers what is left.
float next_surface(vec2 pixel, Ray ray, inout March at, float far, bool last, out Ray seen, out Hit hit) {
    seen = ray;
    hit = no_hit(0.0);
    edge_width = last ? 0.0 : EDGE_REACH * u_pixel;
    march(ray, at, hit, far);
    float width = edge_width;
    edge_width = 0.0;
    if (last || !hit.found || !hit.done) {
#ifdef ANALYTIC
        keep_solved(hit);
        return hit.found && hit.t < solved_t ? 1.0 : horizon(pixel, at, seen, hit);
#else
        return 1.0;
#endif
    }
#ifdef ADVANCE
    float r = edge_distance(ray, at.t);
    float slope = -0.7;
#else
#ifdef ORTHOGRAPHIC
    float r = at.r + width;
    float slope = at.last_derivative;
#else
    float r = at.r * (1.0 + width) + width * at.t;
    float slope = at.last_derivative * (1.0 + width) + width;
#endif
#endif
    Chord chord = chord_from(ray, at.t, r, slope, far);
    vec2 offset = vec2(0.0);
    bool none = chord.least.y > edge_reach(chord.least.x);
    float cover = chord.deep ? 1.0 : none ? 0.0 : covered(pixel, ray, chord, offset);
    bool whole = cover > 1.0 - LEAST_SHARE;
    float end = far;
    if (whole) {
#ifdef ADVANCE
        at = March(chord.entry.x, max(chord.entry.y, 0.0), 0.0, 0.0, -1.0, 0.0, false, false);
#else
        at = March(chord.first.x, chord.first.y, chord.entry.x, chord.entry.y, slope, chord.slope, true, false);
#endif
    } else if (cover > LEAST_SHARE) {
        seen = camera_ray(pixel + offset);
        at = March(at.t, edge_distance(seen, at.t), 0.0, 0.0, clamp(slope, -1.0, 0.0), 0.0, false, false);
        end = at.r > 0.0 ? chord.end : -1.0;  // the ray may start inside of the solid, at its surface
    }
    if (cover > LEAST_SHARE) march(seen, at, hit, end);
    if (!whole) {
        if (!hit.found) hit.t = at.r > 0.0 ? chord.least.x : at.t;
        hit.found = true;
        at = March(chord.end, 0.0, 0.0, 0.0, 0.0, 0.0, false, false);
        return cover;
    }
#ifdef ANALYTIC
    keep_solved(hit);
#endif
    return 1.0;
}

// The start of a pixel's ray.
March first_of(Ray ray, vec2 range) {
    March at = start_march(ray, range.x);
#ifdef OWN_START
    if (range.x <= range.y) enter(ray, at);
    at.r = 0.0;
#else
    at.r /= 1.0 + EDGE_REACH * u_pixel;
#endif
    return at;
}

// The evaluations of the field of all surfaces of a pixel.
float evaluations_with_edges(vec2 pixel) {
    Ray ray = camera_ray(pixel);
    vec2 range = range_of(ray);
    March at = first_of(ray, range);
    float rest = 1.0;
    float count = 0.0;
    edge_evaluations = 0.0;
    for (int i = 0; i <= MOST_EDGES && rest >= LEAST_SHARE; i++) {
        Ray seen;
        Hit hit;
        rest *= 1.0 - next_surface(pixel, ray, at, range.y, i == MOST_EDGES, seen, hit);
        count += hit.evaluations;
    }
    return count + edge_evaluations;
}
