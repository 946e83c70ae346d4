    vec3 weight = vec3(1.0);
    float travelled = 0.0;
#ifdef SHINES
    float min_roughness = 0.0;  // smallest roughness for highlights of lights
#endif
#ifdef GLASS
    float side = 1.0;  // -1 inside glass
    vec3 absorption = vec3(0.0);
    vec3 before = ray.origin;  // previous vertex of the path
#endif
    for (int bounce = 0; bounce <= $bounces; bounce++) {
        travelled += hit.t;
        Surface surface = surface_interaction(ray, hit, travelled);
        surface.t = travelled;
#ifdef GLASS
        if (side < 0.0) weight *= exp(-absorption * distance(before, surface.p));
        before = surface.p;
        surface.normal *= side;
#endif
$visible
        int dimension = 16 + 8 * bounce;
        vec3 direction;
#ifdef GLASS
        Glass glass = glass_at($material);
        bool enters = side < 0.0 || random_of_pixel(dimension + 3) < glass.transmission;
#endif
#ifdef FILMS
        surface.p -= side * min(hit.residual, 0.0) * $solid;  // onto the face
#endif
#ifdef SUBSURFACE
        Surface below = surface;
        bool scatters = random_of_pixel(60000 + 2 * bounce) < surface.material.subsurface;
        surface.material.subsurface = 0.0;  // the part without it
        if (scatters) surface.material.exits = -1.0;
#endif
#ifdef SHINES
        Surface regularized = surface;
$regularized
#endif
#ifdef GLASS
#ifdef SHINES
        if (side > 0.0) color += weight * direct_light(regularized, glass, enters ? 1.0 : 0.0);
#else
        if (!enters) color += weight * direct_light(surface);
#ifdef EMITS
        else if (side > 0.0) color += weight * emission_at($material);
#endif
#endif
#ifdef SHOWS
        bool outside = side > 0.0;
#endif
        if (enters) {
            if (bounce == $bounces) {
                color += weight * $sky(ray.direction);
                break;
            }
#ifdef FROSTED
            vec2 u = vec2(random_of_pixel(dimension + 1), random_of_pixel(dimension + 2));
            float choice = random_of_pixel(dimension + 4);
            float roughness = surface.material.roughness;
            BsdfSample found =
                sample_rough_dielectric(surface.normal, surface.view, glass.ior, side, roughness, u, choice);
            if (found.weight == vec3(0.0)) break;
            weight *= found.weight;
            direction = found.direction;
            if (dot(direction, surface.normal) < 0.0) {
                side = -side;
                absorption = glass.absorption;
            }
#ifdef SHINES
            min_roughness = max(min_roughness, surface.material.roughness);
#endif
#else
            float ratio = side > 0.0 ? 1.0 / glass.ior : glass.ior;
            float cosine = clamp(dot(surface.normal, surface.view), 0.0, 1.0);
            if (random_of_pixel(dimension + 4) < fresnel_dielectric(cosine, ratio)) {
                direction = reflect(ray.direction, surface.normal);
            } else {
                direction = refract(ray.direction, surface.normal, ratio);
                side = -side;
                absorption = glass.absorption;
            }
#endif
        } else {
#else
        color += weight * direct_light($shaded);
#endif
#ifdef SUBSURFACE
        if (scatters) {
            vec3 entry = $entry;
            float chance = clamp(max(max(entry.r, entry.g), entry.b), 0.05, 0.95);
            if (random_of_pixel(60001 + 2 * bounce) < chance) {
                weight *= entry / chance;
                vec3 tint = below.material.subsurface_color;
                Walk walk = Walk(tint, scattering_albedo(tint), below.material.subsurface_radius, weight);
                int numbers = 65536 + 2048 * bounce;
                if (!walk_below(walk, surface.p, $solid, travelled, numbers, ray, hit)) break;
                weight = walk.weight;
                surface = surface_interaction(ray, hit, travelled);
                surface.t = travelled;
                surface.material.exits = 1.0;
#ifdef GLASS
#ifdef SHINES
                color += weight * direct_light(surface, glass, 0.0);
#else
                color += weight * direct_light(surface);
#endif
#else
                color += weight * direct_light(surface);
#endif
            } else {
                weight /= 1.0 - chance;
            }
        }
#endif
$inner        if (bounce == $bounces) break;
$sample
$inner        if (found.weight == vec3(0.0)) break;
$inner        weight *= found.weight;
$inner        direction = found.direction;
#ifdef SHINES
$widened
#endif
#ifdef GLASS
        }
#endif
        float start;
        vec3 side_normal = dot(direction, surface.normal) < 0.0 ? -$solid : $solid;
        ray = spawn_ray(surface.p, side_normal, direction, travelled, start);
$reflects
        hit = trace_secondary(ray, start, travelled, $side);
#ifdef SHOWS
        // surfaces find visible lights by themselves, except through glass
        vec4 shown = visible_light(ray, hit, travelled);
        if (shown.w >= 0.0) {
#ifdef GLASS
            if (side < 0.0) weight *= exp(-absorption * shown.w);
            if (enters && (!outside || side < 0.0)) color += weight * shown.rgb;
#endif
            break;
        }
#endif
        if (!hit.found) {
#ifdef GLASS
            if (side > 0.0) color += weight * $sky(direction);
#else
            color += weight * $sky(direction);
#endif
            break;
        }
    }
$sees
