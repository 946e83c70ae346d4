// The point just inside the solid under a hit, where materials are evaluated. A face may lie on a discontinuity of a
// pattern, as a floor does on the border of a checker's cells. It then shows the side inside the solid, independent of
// the rounding of each hit.
// The offset is the residual of the hit plus eight ulp of the coordinates. These cover the rounding of the field and of
// the transforms to object space.
// needs: Hit nearness
// gives: inner_point
vec3 inner_point(vec3 p, vec3 normal, Hit hit, float travelled) {
    return p - (hit.residual + 4.0 * nearness(p, travelled, 0.0)) * normal;
}
