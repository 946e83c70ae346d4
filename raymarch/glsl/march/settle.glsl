// The last steps towards a surface, from a sample that is within an epsilon of one. Steps along the slope of the last
// two samples take out nearly all of the residual, and each proves itself by a smaller one. False if the ray only passes
// by: it must go on then, or edges and silhouettes would be an epsilon too wide and show normals of what faces away.
// Along a wall the slope is nearly 0, and leads through whatever stands on the wall. No value proves such a leap free, so
// that the first is at most a pixel wide, and the next no longer than the way on which the slope has held.
// needs: Ray Hit along contact u_pixel
// gives: settle
bool settle(inout Hit hit, Ray ray, float t, float r, float slope) {
    hit.t = t;
    hit.residual = abs(r);
    float enough = contact(ray.origin + t * ray.direction, t);
    float leap = u_pixel * t;
    for (int i = 0; i < 8 && hit.residual > enough; i++) {
        float z = slope < 0.0 ? min(r / -slope, r + leap) : r;
        float next = along(ray, hit.t + z);
        hit.evaluations += 1.0;
        if (abs(next) < hit.residual) {
            slope = (next - r) / z;
            leap += z;
            r = next;
            hit.t += z;
            hit.residual = abs(r);
        } else if (slope < 0.0 && z > r) {
            slope = 0.0;  // the slope misled: a plain step cannot
        } else {
            break;
        }
    }
    hit.found = hit.residual <= enough;
    return hit.found;
}
