// The normal from four samples on a tetrahedron. The error is of first order in the step, so the step is the square
// root of an ulp of the largest coordinate, where rounding and truncation errors are equal.
vec3 surface_normal(vec3 p, vec3 direction) {
    float h = 3.4526698e-4 * max(1.0e-12, max(abs(p.x), max(abs(p.y), abs(p.z))));
    vec2 k = vec2(1.0, -1.0);
    vec3 g = k.xyy * field(p + h * k.xyy) + k.yyx * field(p + h * k.yyx)
        + k.yxy * field(p + h * k.yxy) + k.xxx * field(p + h * k.xxx);
    float size = length(g);
    return size > 0.0 ? g / size : -direction;
}
