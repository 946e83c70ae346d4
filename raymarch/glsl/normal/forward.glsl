// The normal from forward differences. The value at the point itself is subtracted, because the point is not exactly on
// the surface. The error is of first order, so the step is the square root of an ulp of the largest coordinate.
vec3 surface_normal(vec3 p, vec3 direction) {
    float h = 3.4526698e-4 * max(1.0e-12, max(abs(p.x), max(abs(p.y), abs(p.z))));
    vec2 k = vec2(h, 0.0);
    vec3 g = vec3(field(p + k.xyy), field(p + k.yxy), field(p + k.yyx)) - field(p);
    float size = length(g);
    return size > 0.0 ? g / size : -direction;
}
