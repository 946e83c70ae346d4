// The field along a ray, positive on the side of the camera: from inside a solid, the inner surface is visible.
float march_distance(Ray ray, float t) {
#ifdef ANALYTIC
    return u_side * ray_field(ray.origin + t * ray.direction, u_side < 0.0);
#else
    return u_side * field(ray.origin + t * ray.direction);
#endif
}
