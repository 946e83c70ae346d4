// The normal from central differences. Their error is of second order in the step, so the step is the cube root of an
// ulp of the largest coordinate, where rounding and truncation errors are equal.
vec3 surface_normal(vec3 p, vec3 direction) {
    float h = 4.9215666e-3 * max(1.0e-12, max(abs(p.x), max(abs(p.y), abs(p.z))));
    vec2 k = vec2(h, 0.0);
    vec3 g = vec3(
        field(p + k.xyy) - field(p - k.xyy),
        field(p + k.yxy) - field(p - k.yxy),
        field(p + k.yyx) - field(p - k.yyx));
    float size = length(g);
    return size > 0.0 ? g / size : -direction;
}
