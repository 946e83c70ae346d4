// Packs a march and its hit into three texels, so that a later pass resumes it exactly.
vec4 packed_march(March at, Hit hit, bool under_way) {
    float flags = (at.refining ? 1.0 : 0.0) + (at.passing ? 2.0 : 0.0) + (hit.done ? 8.0 : 0.0);
    flags += (hit.found ? 16.0 : 0.0) + (under_way ? 32.0 : 0.0);
#ifdef OWN_START
    flags += u_side < 0.0 ? 4.0 : 0.0;
#endif
    return vec4(at.t, at.r, at.derivative, flags + 64.0 * hit.fallbacks);
}

vec4 packed_hit(Hit hit) {
    return vec4(hit.t, hit.residual, hit.iterations, hit.evaluations);
}

vec4 packed_more(March at) {
    vec4 more = vec4(at.last_derivative, at.kept_t, at.kept_r, 0.0);
#ifdef STRETCH
    more.w = stretch_ahead;
#else
#ifdef ADVANCE
    more.w = approach;
#endif
#endif
    return more;
}

bool flag(vec4 march, float bit) {
    return mod(floor(march.w / bit), 2.0) == 1.0;
}

March unpack_march(vec4 march, vec4 more) {
#ifdef STRETCH
    stretch_ahead = more.w;
#else
#ifdef ADVANCE
    approach = more.w;
#endif
#endif
    return March(march.x, march.y, more.y, more.z, march.z, more.x, flag(march, 1.0), flag(march, 2.0));
}

Hit unpack_hit(vec4 march, vec4 hit) {
#ifdef OWN_START
    u_side = flag(march, 4.0) ? -1.0 : 1.0;
#endif
    return Hit(flag(march, 8.0), flag(march, 16.0), hit.x, hit.y, hit.z, hit.w, floor(march.w / 64.0));
}
