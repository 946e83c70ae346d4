// Directional light; `direction` points towards it. No point of the scene is farther from the camera than u_far, so no
// two points are farther apart than twice that.
Light sun_light(vec3 direction, vec3 radiance) {
    return Light(direction, 2.0 * u_far, radiance);
}
