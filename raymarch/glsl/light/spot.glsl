// Angular falloff of a spot light: 0 at the cosine `outer` to its axis, 1 from `inner` on.
float spot_falloff(vec3 to_light, vec3 axis, float outer, float inner) {
    float rise = clamp((dot(-to_light, axis) - outer) / max(inner - outer, 1.0e-6), 0.0, 1.0);
    return rise * rise;
}
