// The field along a ray, with the sign that it has at the camera, so that a camera inside a solid sees the inner
// surface.
float march_distance(Ray ray, float t) {
#ifdef ANALYTIC
    return u_side * ray_field(ray.origin + t * ray.direction, u_side < 0.0);
#else
    return u_side * field(ray.origin + t * ray.direction);
#endif
}
