// The field along a ray, with the sign that it has at the camera, so that a camera inside a solid sees the inner
// surface.
float march_distance(Ray ray, float t) {
    return u_side * field(ray.origin + t * ray.direction);
}
