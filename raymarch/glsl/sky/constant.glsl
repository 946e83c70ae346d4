// A sky of one colour.
vec3 sky(vec3 direction) {
    return sky_color();
}
