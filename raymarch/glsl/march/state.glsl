// A march and what it found, as two texels, so that a later pass may go on.
// needs: Hit March
// gives: packed_march packed_hit unpack_march unpack_hit flag
vec4 packed_march(March at, Hit hit) {
    float flags = (at.asked ? 1.0 : 0.0) + (at.passing ? 2.0 : 0.0) + (hit.done ? 4.0 : 0.0) + (hit.found ? 8.0 : 0.0);
    return vec4(at.t, at.r, at.slope, flags + 16.0 * hit.fallbacks);
}

vec4 packed_hit(Hit hit) {
    return vec4(hit.t, hit.residual, hit.iterations, hit.evaluations);
}

bool flag(vec4 march, float bit) {
    return mod(floor(march.w / bit), 2.0) == 1.0;
}

March unpack_march(vec4 march) {
    return March(march.x, march.y, march.z, flag(march, 1.0), flag(march, 2.0));
}

Hit unpack_hit(vec4 march, vec4 hit) {
    return Hit(flag(march, 4.0), flag(march, 8.0), hit.x, hit.y, hit.z, hit.w, floor(march.w / 16.0));
}
