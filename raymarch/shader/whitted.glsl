#ifdef GLASS
    // GLSL has no recursion: the refracted ray goes on, and the reflected one waits.
#ifdef STACK
    Branch waiting[$bounces];
    int count = 0;
#else
    // It waits as one bit. Its path is then followed again from the camera: the hits are known, so nothing is marched.
    vec4 lengths = vec4(hit.t);  // of the rays of the path, up to their hits
    vec4 residuals = vec4(hit.residual);
    int known = 1;  // number of hits of the path
    int mirrored = 0;  // bit k: ray k + 1 of the path is the reflected one
    int waiting = 0;  // bit k: the ray that hit k reflects is yet to be traced
#endif
    Branch at = Branch(ray, 0.0, vec3(1.0), vec3(0.0), 0.0, 1.0, 0$camera);
    for (int i = 0; i < $turns; i++) {
        bool ends = false;
#ifndef STACK
        bool again = i > 0 && at.bounce < known;
        if (at.bounce < known) {
            hit.t = lengths[at.bounce];
            hit.residual = residuals[at.bounce];
        }
#endif
        if ($traced_now) {
$reflects
            hit = trace_secondary(at.ray, at.start, at.travelled, at.side);
            ends = !hit.found;
#ifdef SHOWS
            // surfaces find visible lights by themselves, except through glass
            vec4 shown = visible_light(at.ray, hit, at.travelled);
            if (shown.w >= 0.0) {
                ends = true;
                if (at.side < 0.0) at.weight *= exp(-shown.w * at.absorption);
                if (at.refracted) color += at.weight * shown.rgb;
            } else
#endif
            if (ends && at.side > 0.0) color += at.weight * $sky(at.ray.direction);
        }
        if (!ends) {
            at.travelled += hit.t;
            if (at.side < 0.0) at.weight *= exp(-hit.t * at.absorption);
            Surface surface = surface_interaction(at.ray, hit, at.travelled);
            surface.t = at.travelled;
            surface.normal *= at.side;
$visible
            Glass glass = glass_at($material);
            float transmission = at.side < 0.0 ? 1.0 : glass.transmission;
            $lobes traced = $traced;
            Surface lit = surface;
$regularized
#ifdef LIGHTS
            if (${fresh}at.side > 0.0) color += at.weight * direct_light(lit, traced, glass, transmission);
#else
            if (${fresh}transmission < 1.0)
                color += (1.0 - transmission) * at.weight * direct_light(lit, traced);
#ifdef EMITS
            if (${fresh}at.side > 0.0) color += transmission * at.weight * emission_at($material);
#endif
#endif
            if (at.bounce == $bounces) {
                ends = true;
                color += transmission * at.weight * $sky(at.ray.direction);
            } else {
                float ratio = at.side > 0.0 ? 1.0 / glass.ior : glass.ior;
                float reflectance = fresnel_dielectric(clamp(dot(surface.normal, surface.view), 0.0, 1.0), ratio);
                if (below_cutoff(reflectance * at.weight)) reflectance = 0.0;
                if (below_cutoff((1.0 - reflectance) * at.weight)) reflectance = 1.0;
                vec3 reflected = (transmission * reflectance) * at.weight;
#ifdef MIRRORS
                reflected += (1.0 - transmission) * at.weight * $mirrored;
#endif
                vec3 refracted = (transmission * (1.0 - reflectance)) * at.weight;
                bool mirrors = below_cutoff(refracted);
                bool both = !mirrors && !below_cutoff(reflected);
                vec3 direction = at.ray.direction;
#ifdef STACK
                if (both) {
                    Branch next = at;
                    next.ray = spawn_ray(surface.p, $solid, reflect(direction, surface.normal), at.travelled, next.start);
                    next.weight = reflected;
#ifdef SHOWS
                    next.refracted = at.side < 0.0;
#endif
                    next.bounce++;
                    waiting[count++] = next;
                }
#else
                int bit = 1 << at.bounce;
                if (again) {
                    mirrors = (mirrored & bit) != 0;
                } else {
                    lengths[at.bounce] = hit.t;
                    residuals[at.bounce] = hit.residual;
                    known = at.bounce + 1;
                    if (mirrors) mirrored |= bit;
                    if (both) waiting |= bit;
                }
#endif
                ends = mirrors && below_cutoff(reflected);
                direction = mirrors ? reflect(direction, surface.normal) : refract(direction, surface.normal, ratio);
                vec3 side = mirrors ? $solid : -$solid;
                at.ray = spawn_ray(surface.p, side, direction, at.travelled, at.start);
                at.weight = mirrors ? reflected : refracted;
#ifdef SHOWS
                at.refracted = !mirrors || at.side < 0.0;
#endif
                if (!mirrors) at.absorption = glass.absorption;
                if (!mirrors) at.side = -at.side;
                at.bounce++;
            }
        }
        if (ends) {
#ifdef STACK
            if (count == 0) break;
            at = waiting[--count];
#else
            if (waiting == 0) break;
            int last = waiting >= 8 ? 3 : waiting >= 4 ? 2 : waiting >= 2 ? 1 : 0;  // the deepest that waits
            int bit = 1 << last;
            waiting -= bit;
            mirrored = (mirrored & (bit - 1)) + bit;
            known = last + 1;
            at = Branch(ray, 0.0, vec3(1.0), vec3(0.0), 0.0, 1.0, 0$camera);
#endif
        }
    }
#else
    vec3 weight = vec3(1.0);
    float travelled = 0.0;
    for (int bounce = 0; bounce <= $bounces; bounce++) {
        if (!hit.found) {
            color += weight * $sky(ray.direction);
            break;
        }
        travelled += hit.t;
        Surface surface = surface_interaction(ray, hit, travelled);
        surface.t = travelled;
$visible
        $lobes traced = $traced;
        Surface lit = surface;
$regularized
        color += weight * direct_light(lit, traced);
        weight *= $mirrored;
        if (below_cutoff(weight)) break;
        vec3 direction = reflect(ray.direction, surface.normal);
        float start;
        ray = spawn_ray(surface.p, $solid, direction, travelled, start);
$reflects
        hit = trace_secondary(ray, start, travelled, 1.0);
#ifdef SHOWS
        if (visible_light(ray, hit, travelled).w >= 0.0) break;  // surfaces find it by themselves
#endif
    }
#endif
$sees
