// The field along a ray, with the sign that it has at the camera: a camera inside a solid sees its inner wall.
// In a pass that marches cones: how far a cone may go on. A cone's directions differ from its axis by no more than
// u_cone, so at t its points lie within u_cone t of the axis; f - u_cone t, over 1 + u_cone to be 1-Lipschitz in t again,
// is safe for them all. After Bálint and Valasek 2018, whose angle holds for a field of view of 90 degrees alone.
// needs: field Ray u_side
// gives: march_distance u_cone
uniform float u_cone;

float march_distance(Ray ray, float t) {
    float r = u_side * field(ray.origin + t * ray.direction);
#ifdef CONE
    r = (r - u_cone * t) / (1.0 + u_cone);
#endif
    return r;
}
