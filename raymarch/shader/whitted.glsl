#ifdef GLASS
    Branch waiting[$branches];
    int count = 0;
    Branch at = Branch(ray, 0.0, vec3(1.0), vec3(0.0), 0.0, 1.0, 0$camera);
    for (int i = 0; i < $rays; i++) {
        if (i > 0) {
            if (count == 0) break;
            at = waiting[--count];
$reflects
            hit = trace_secondary(at.ray, at.start, at.travelled, at.side);
#ifdef SHOWS
            // surfaces find visible lights by themselves, except through glass
            vec4 shown = visible_light(at.ray, hit, at.travelled);
            if (shown.w >= 0.0) {
                if (at.side < 0.0) at.weight *= exp(-shown.w * at.absorption);
                if (at.refracted) color += at.weight * shown.rgb;
                continue;
            }
#endif
            if (!hit.found) {
                if (at.side > 0.0) color += at.weight * $sky(at.ray.direction);
                continue;
            }
        }
        at.travelled += hit.t;
        if (at.side < 0.0) at.weight *= exp(-hit.t * at.absorption);
        Surface surface = $surface;
        surface.t = at.travelled;
        surface.normal *= at.side;
$visible
        Glass glass = glass_at($material);
        float transmission = at.side < 0.0 ? 1.0 : glass.transmission;
        $lobes traced = $traced;
#ifdef MIRRORS
        vec3 reflection = $mirrored;
#endif
$regularized
#ifdef LIGHTS
        if (at.side > 0.0) color += at.weight * direct_light(surface, traced, glass, transmission);
#else
        if (transmission < 1.0) color += (1.0 - transmission) * at.weight * direct_light(surface, traced);
#ifdef EMITS
        if (at.side > 0.0) color += transmission * at.weight * emission_at($material);
#endif
#endif
        if (at.bounce == $bounces) {
            color += transmission * at.weight * $sky(at.ray.direction);
            continue;
        }
        float ratio = at.side > 0.0 ? 1.0 / glass.ior : glass.ior;
        float reflectance = fresnel_dielectric(clamp(dot(surface.normal, surface.view), 0.0, 1.0), ratio);
        if (below_cutoff(reflectance * at.weight)) reflectance = 0.0;
        if (below_cutoff((1.0 - reflectance) * at.weight)) reflectance = 1.0;
        vec3 reflected = (transmission * reflectance) * at.weight;
#ifdef MIRRORS
        reflected += (1.0 - transmission) * at.weight * reflection;
#endif
        vec3 refracted = (transmission * (1.0 - reflectance)) * at.weight;
        at.bounce++;
        float start;
        if (!below_cutoff(reflected)) {
            vec3 direction = reflect(at.ray.direction, surface.normal);
            Ray next = spawn_ray(surface.p, $solid, direction, at.travelled, start);
            waiting[count++] = Branch(next, start, reflected, at.absorption, at.travelled, at.side, at.bounce$reflected);
        }
        if (!below_cutoff(refracted)) {
            vec3 direction = refract(at.ray.direction, surface.normal, ratio);
            Ray next = spawn_ray(surface.p, -$solid, direction, at.travelled, start);
            waiting[count++] = Branch(next, start, refracted, glass.absorption, at.travelled, -at.side, at.bounce$refracted);
        }
    }
#else
    vec3 weight = vec3(1.0);
    float travelled = 0.0;
    for (int bounce = 0; bounce <= $bounces; bounce++) {
        travelled += hit.t;
        Surface surface = $surface;
        surface.t = travelled;
$visible
        $lobes traced = $traced;
        vec3 reflection = $mirrored;
$regularized
        color += weight * direct_light(surface, traced);
        weight *= reflection;
        if (below_cutoff(weight)) break;
        vec3 direction = reflect(ray.direction, surface.normal);
        float start;
        ray = spawn_ray(surface.p, $solid, direction, travelled, start);
$reflects
        hit = trace_secondary(ray, start, travelled, 1.0);
#ifdef SHOWS
        if (visible_light(ray, hit, travelled).w >= 0.0) break;  // surfaces find it by themselves
#endif
        if (!hit.found) {
            color += weight * $sky(ray.direction);
            break;
        }
    }
#endif
$sees
