// The first sample of a ray that starts at a point of its own. Its sign tells whether the ray starts inside a solid; the
// ray then hits the inner surface.
void enter(Ray ray, inout March at) {
    float r = field(ray.origin + at.t * ray.direction);
    u_side = r < 0.0 ? -1.0 : 1.0;
    at.r = abs(r);
}
