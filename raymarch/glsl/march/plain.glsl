// Plain sphere tracing (Hart 1996): each step is the distance itself, so no surface is stepped over.
// A camera inside a solid sees its inner wall: the field is marched with the sign that it has at the camera.
// A ray that runs out of steps takes the point where it came nearest, if that is within a pixel.
// needs: field Ray Hit missed nearer settle u_side u_pixel epsilon contact max_steps step_scale
// gives: march
Hit march(Ray ray, float near, float far) {
    Hit hit = missed(near);
    float t = near;
    float last = 0.0;
    float slope = 0.0;
    bool passing = false;  // near a surface, but not to meet it: from then on only contact counts
    for (int i = 0; i < max_steps; i++) {
        vec3 p = ray.origin + t * ray.direction;
        float r = u_side * field(p);
        if (i > 0) slope = (r - last) / (step_scale * last);  // `last` is not 0: it would have been a hit
        hit.iterations += 1.0;
        hit.evaluations += 1.0;
        nearer(hit, t, r);
        if (r < (passing ? contact(p, t) : epsilon(p, t))) {
            if (settle(hit, ray, t, r, slope)) return hit;
            passing = true;
        }
        last = r;
        t += step_scale * r;
        if (t > far) return hit;
    }
    hit.certified = 0.0;
    hit.found = hit.residual < u_pixel * hit.t;
    return hit;
}
