// Hard shadow of a sun: anything up to the end of the scene is in its way. No point of the scene is farther from
// the camera than u_far, so no two are farther apart than twice that.
// needs: shadow_ray u_far
// gives: sun_shadow
float sun_shadow(vec3 p, vec3 normal, float t, vec3 direction) {
    return shadow_ray(p, normal, t, direction, 2.0 * u_far);
}
