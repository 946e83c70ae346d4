// The field along a ray, positive on the side of the camera: from inside a solid, the inner surface is visible.
#ifdef CONES
#ifdef WIDE_CONE
// In a pass that marches cones: the safe step of a cone. At t its points lie within u_cone_start + u_cone t of the
// axis: its rays start within u_cone_start of it, and their directions differ from it by at most u_cone.
#else
// In a pass that marches cones: the safe step of a cone. A cone's directions differ from its axis by at most u_cone, so
// at t its points lie within u_cone t of the axis. (f - u_cone t) / (1 + u_cone) is safe for all of them, and
// 1-Lipschitz in t. After Bálint and Valasek 2018, whose angle holds only for a field of view of 90 degrees.
#endif
#endif
float march_distance(Ray ray, float t) {
#ifdef ANALYTIC
    float r = u_side * ray_field(ray.origin + t * ray.direction, u_side < 0.0);
#else
    float r = u_side * field(ray.origin + t * ray.direction);
#endif
#ifdef EDGES
#ifdef ORTHOGRAPHIC
    r -= edge_width;
#else
    r = (r - edge_width * t) / (1.0 + edge_width);
#endif
#endif
#ifdef CONE
#ifdef WIDE_CONE
    r = (r - u_cone_start - u_cone * t) / (1.0 + u_cone);
#else
    r = (r - u_cone * t) / (1.0 + u_cone);
#endif
#endif
    return r;
}
