// A light from infinitely far away; `direction` points towards it.
// needs: Material phong
// gives: sun_light
vec3 sun_light(Material material, vec3 normal, vec3 view, vec3 direction, vec3 radiance, float visibility) {
    return phong(material, normal, view, direction, radiance, visibility);
}
