// Plain sphere tracing (Hart 1996): each step is the distance itself, so no surface is stepped over.
// A camera inside a solid sees its inner wall: the field is marched with the sign that it has at the start.
// A ray that runs out of steps takes the point where it came nearest, if that is within a pixel.
// The last two samples (the earlier is never 0, it would have been a hit) give the slope of the field along the ray; a secant step takes out most of the residual.
// needs: field Ray epsilon max_steps
// gives: Hit march
struct Hit {
    bool found;
    float side;  // -1 if the ray started inside a solid, else 1
    float t;
    float residual;
    float iterations;
    float evaluations;
};

Hit march(Ray ray, float near, float far) {
    Hit hit = Hit(false, 1.0, near, 0.0, 0.0, 0.0);
    float t = near;
    float last = 0.0;
    float slope = 0.0;
    float nearest = 1.0e30;
    bool exhausted = true;
    for (int i = 0; i < max_steps; i++) {
        vec3 p = ray.origin + t * ray.direction;
        float r = field(p);
        if (i == 0 && r < 0.0) hit.side = -1.0;
        r *= hit.side;
        if (i > 0) slope = (r - last) / last;
        hit.iterations += 1.0;
        if (r < nearest * t) {
            nearest = r / max(t, 1.0e-30);
            hit.t = t + (slope < 0.0 ? min(r / -slope, t) : 0.0);
            hit.residual = r;
        }
        if (r < epsilon(p, t)) {
            hit.found = true;
            hit.t = t + (slope < 0.0 ? min(r / -slope, t) : 0.0);
            hit.residual = r;
            exhausted = false;
            break;
        }
        last = r;
        t += r;
        if (t > far) {
            exhausted = false;
            break;
        }
    }
    if (exhausted) hit.found = nearest < u_pixel;
    hit.evaluations = hit.iterations;
    return hit;
}
