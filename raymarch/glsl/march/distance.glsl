// The field along a ray, with the sign that it has at the camera, so that a camera inside a solid sees the inner
// surface.
// needs: field Ray u_side
// gives: march_distance
float march_distance(Ray ray, float t) {
    return u_side * field(ray.origin + t * ray.direction);
}
