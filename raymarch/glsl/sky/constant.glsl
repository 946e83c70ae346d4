// A sky of one colour.
// needs: sky_color
// gives: sky
vec3 sky(vec3 direction) {
    return sky_color();
}
