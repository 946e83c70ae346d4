// Where a secondary ray has left the solid in closed form that it starts from: after 128 ulp of its coordinates.
float left_behind(vec3 p, float travelled) {
    return 64.0 * nearness(p, travelled, 0.0);
}
