// What a ray found, and what it took.
// needs: field Ray contact
// gives: Hit u_side missed nearer settle
uniform float u_side;  // -1 if the camera is inside a solid, else 1: the sign with which the field is marched

struct Hit {
    bool found;
    float t;
    float residual;
    float iterations;
    float evaluations;
    float fallbacks;  // steps that proved too long and were undone
    float certified;  // 1 if the field's promise rules out a surface before t
};

Hit missed(float near) {
    return Hit(false, near, 0.0, 0.0, 0.0, 0.0, 1.0);
}

// Keeps the sample with the smallest residual as seen from the camera: what a ray that runs out of steps falls back on.
void nearer(inout Hit hit, float t, float r) {
    if (hit.evaluations > 1.0 && r * hit.t >= hit.residual * t) return;
    hit.t = t;
    hit.residual = r;
}

// The last steps towards a surface, from a sample that is within an epsilon of one. Steps along the slope of the last
// two samples take out nearly all of the residual, and each proves itself by a smaller one. False if the ray only passes
// by: it must go on then, or edges and silhouettes would be an epsilon too wide and show normals of what faces away.
bool settle(inout Hit hit, Ray ray, float t, float r, float slope) {
    hit.t = t;
    hit.residual = abs(r);
    float enough = contact(ray.origin + t * ray.direction, t);
    for (int i = 0; i < 4 && hit.residual > enough; i++) {
        float z = slope < 0.0 ? min(r / -slope, t) : r;
        float next = u_side * field(ray.origin + (hit.t + z) * ray.direction);
        hit.evaluations += 1.0;
        if (abs(next) < hit.residual) {
            slope = (next - r) / z;
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
