// Soft shadow: the visible fraction of the light's disc. `width` is the sine of its angular radius. A ray to the middle
// of the disc finds whether any of it is hidden, and whether all of it is: where its clearance is the radius of
// the disc, and where it is as deep in a solid. Else six more rays go to a hexagon on the disc, in the part of the way
// where solids reach into the cone. Each counts by its clearance, up to the disc's radius, and a hidden one not at all.
// So what is thin and wide hides all, and no step is seen in a penumbra: where a thin solid leaves one ray, its
// neighbours are near it already.
// A straight edge at the clearance of the middle, on the side where the others find it, leaves a known fraction and is
// counted as another one: their ratio of odds corrects the count. The less the rays find a side, the more it is that of
// a solid in the middle, fitted to rods, balls, boxes, gaps and corners. Two edges beside the middle leave the least
// that is a gap. Near both ends of the penumbra a straight edge is taken.
// Seven rays do not tell a gap, a hole and a slot apart, where few are free but not as beside a straight edge. There 24
// more go to a spiral over the disc, count in full from a clearance of 0.15 of its radius, and by one ratio of odds.
// The disc is at least 64 ulp of the coordinates wide, because the field is exact to a few ulp only.
float two_sided_shadow(Surface surface, Light light, float width) {
    if (dot(surface.normal, light.direction) <= 0.0 || light.radiance == vec3(0.0)) return 0.0;
    vec2 range;
    float first;
    Ray ray = shadow_ray(surface, light, range, first);
    range = scene_cone(ray, range, width);
    if (range.x >= range.y) return 1.0;
    width = clamp(width, 64.0 * GROWTH, 0.999);
    vec3 axis = ray.direction;
    float middle = 0.0;
    // what the seven rays find; then the fraction of the disc, the share of the 24 rays, and their sum
    float around[7];
    for (int i = 0; i < 31; i++) {
        if (i == 7) {
            float edge = max(beside_edge(middle), 0.0);  // asin rounds
            float counted = 0.0;
            vec2 rise = vec2(0.0);
            float sum = 0.0;
            for (int k = 0; k < 7; k++) {
                counted += share_of_seven(k, around[k]);
                if (k > 0) rise += around[k] * ray_of_disc(k);
                if (k > 0) sum += around[k];
            }
            float sided = length(rise);
            float expected = 0.0;
            float off = 0.0;
            for (int k = 0; k < 7; k++) {
                float free = free_of_seven(min(middle + dot(rise, ray_of_disc(k)) / max(sided, 1.0e-6), 1.0));
                expected += share_of_seven(k, free);
                if (k > 0) off += abs(around[k] - free);
            }
            float opposite = around[1] * around[4] + around[2] * around[5] + around[3] * around[6];
            around[1] = few_of_seven(middle, off, sum, sided);
            expected = clamp(expected, 0.01, 0.99);
            float odds = clamp(edge * (1.0 - expected) / (expected * (1.0 - edge)), 0.3, 6.0);
            odds = exp(mix(1.15 + 1.2 * opposite, log(odds), smoothstep(0.0, 0.1 + 0.85 * sum, sided)));
            float visible = odds * counted / (1.0 + (odds - 1.0) * counted);
            if (middle > 0.0) visible = max(visible, 2.0 * edge - 1.0);
            around[0] = mix(visible, edge, smoothstep(0.5, 0.9, abs(middle)));
            around[2] = 0.0;
            if (around[1] <= 0.0) break;
        }
        vec3 right = normalize(abs(axis.y) < 0.7 ? vec3(axis.z, 0.0, -axis.x) : vec3(0.0, axis.z, -axis.y));
        vec2 place = ray_of_disc(i);
        ray.direction = width * (place.x * right + place.y * cross(axis, right));
        ray.direction += sqrt(1.0 - dot(ray.direction, ray.direction)) * axis;
        vec2 between = range;
        float narrow = max(0.15 * width, 64.0 * GROWTH);
        float found = clearance(ray, between, i == 0 ? first : 0.0, 0.0, i < 7 ? width : narrow, i == 0);
        if (i > 6) {
            around[2] += seen_of_disc(found);
            continue;
        }
        around[i] = free_of_seven(found);
        if (i > 0) continue;
        if (abs(found) > 0.95) return max(beside_edge(found), 0.0);
        middle = found;
        range = between;
    }
    float seen = around[2] / 24.0;
    return mix(around[0], 1.35 * seen / (1.0 + 0.35 * seen), around[1]);
}
