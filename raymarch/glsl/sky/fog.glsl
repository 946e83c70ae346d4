// Fog between the eye and a surface: exp(-density t) of the light comes through.
// needs: fog_color fog_density
// gives: apply_fog
vec3 apply_fog(vec3 color, float t) {
    return mix(fog_color(), color, exp(-fog_density() * t));
}
