// The last steps towards a surface, from a sample that is within an epsilon of one. Steps along the derivative of the last
// two samples take out nearly all of the residual, and each proves itself by a smaller one. False if the ray only passes
// by: it must go on then, or edges and silhouettes would be an epsilon too wide and show normals of what faces away.
// Along a wall the derivative is nearly 0, and leads through whatever stands on the wall. No value proves such a leap free, so
// that the first is at most a pixel wide, and the next no longer than the way on which the derivative has held.
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
            derivative = 0.0;  // the derivative misled: a plain step cannot
        } else {
            break;
        }
    }
    hit.found = hit.residual <= enough;
    return hit.found;
}
