// The rounding error of the field at t along a ray: 2 ulp of the largest coordinate. Where `contact_share` is below
// 1/16, the field is flat along some axis, and values of hits are smaller: the error counts in the same share.
float rounding(Ray ray, float t) {
    vec3 size = abs(ray.origin);
    float ulps = 2.0 * GROWTH * (max(size.x, max(size.y, size.z)) + t);
    return min(16.0 * contact_share, 1.0) * ulps;
}
