// The depth below a hit at which materials are evaluated: its residual plus 8 ulp of the coordinates, for rounding. A
// face that lies on a border of a pattern, as a checkered floor may, thus shows the side inside the solid.
float inner_depth(vec3 p, Hit hit, float travelled) {
    return hit.residual + 4.0 * nearness(p, travelled, 0.0);
}
