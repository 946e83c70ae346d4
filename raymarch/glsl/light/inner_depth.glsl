// The depth below a hit at which materials are evaluated: the residual of the hit plus eight ulp of the coordinates.
// These cover the rounding of the field and of the transforms to object space.
// A face may lie on a discontinuity of a pattern, as a floor does on the border of a checker's cells. It then shows the
// side inside the solid, independent of the rounding of each hit.
float inner_depth(vec3 p, Hit hit, float travelled) {
    return hit.residual + 4.0 * nearness(p, travelled, 0.0);
}
