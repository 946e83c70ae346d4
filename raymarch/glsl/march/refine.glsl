// Refines a hit from a sample within an epsilon of a surface. Secant steps along the derivative of the last two samples
// remove nearly all of the residual. Each is accepted only if the residual becomes smaller. Returns false if the ray
// only passes the surface. It must then march on, or edges and silhouettes would be an epsilon too wide and show
// normals of back faces.
// Along a surface the derivative is nearly 0 and a secant step may pass through an object that stands on the surface.
// No value certifies such a step as empty, so the first is at most a pixel wide, and the next no longer than the
// distance over which the derivative has held.
// needs: Ray Hit march_distance contact u_pixel
// gives: refine_hit
bool refine_hit(inout Hit hit, Ray ray, float t, float r, float derivative) {
    hit.t = t;
    hit.residual = abs(r);
    float enough = contact(ray.origin + t * ray.direction, t);
    float leap = u_pixel * t;
    for (int i = 0; i < 8 && hit.residual > enough; i++) {
        float z = derivative < 0.0 ? min(r / -derivative, r + leap) : r;
        float next = march_distance(ray, hit.t + z);
        hit.evaluations += 1.0;
        if (abs(next) < hit.residual) {
            derivative = (next - r) / z;
            leap += z;
            r = next;
            hit.t += z;
            hit.residual = abs(r);
        } else if (derivative < 0.0 && z > r) {
            derivative = 0.0;  // the derivative was misleading; try a plain step
        } else {
            break;
        }
    }
    hit.found = hit.residual <= enough;
    return hit.found;
}
