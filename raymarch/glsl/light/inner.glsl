// The point just inside the solid under a hit, where its material is evaluated. A face may lie on a jump of a pattern, as
// a floor does on the border of a checker's cells: it shows the side that the solid fills, not the rounding of each hit.
// A hit is off the surface by its residual. Eight ulp of the coordinates more are for the rounding of the field and of
// the transforms into the space of the material.
// needs: Hit nearness
// gives: inner_point
vec3 inner_point(vec3 p, vec3 normal, Hit hit, float travelled) {
    return p - (hit.residual + 4.0 * nearness(p, travelled, 0.0)) * normal;
}
