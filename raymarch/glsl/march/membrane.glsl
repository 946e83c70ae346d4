// Whether a ray that comes within a hit's width of a surface enters the solid. Where a cut is flush with a face, the
// field falls to 0 and rises again: a membrane of no thickness, which is no surface. The ray is in doubt until a sample
// is inside. It steps down the slope. If the field rises there, the ray looks for the least value between two samples
// on opposite sides of it, which falls and rises at the steepest rate so far. If no such sample is inside, the ray goes
// on behind the membrane.
// In doubt, (t, r) is the last sample before the surface, (-kept_t, kept_r) the one behind it, and last_derivative the
// rate. It is positive once the field has risen, and `derivative` is then the number of samples left.
float noise_of(Ray ray, float t) {
#ifdef CONE
    return -1.0e30;  // a cone stops before the surface, so it is never in doubt
#endif
#ifdef EDGES
    if (edge_width > 0.0) return -1.0e30;
#endif
    return rounding(ray, t);
}

// How far below a surface a step aims, so that its sample is inside.
float doubt_depth(Ray ray, vec3 widths, float t) {
    return max(0.7 * width_at(widths, hit_width(widths), t) + noise_of(ray, t), 0.0);
}

bool in_doubt(March at) {
    return at.kept_t < 0.0;
}

void doubt(inout March at, float t, float r, float derivative) {
    at.kept_t = -t;
    at.kept_r = r;
    at.last_derivative = -max(max(-at.last_derivative, -derivative), 0.05);
}

// `most`: how much longer than to the end of the sphere a step down the slope may be.
float doubt_step(March at, float depth, float most) {
    float behind = -at.kept_t - at.t;
    if (at.last_derivative > 0.0) return 0.5 * (behind + (at.r - at.kept_r) / at.last_derivative);
    return behind + min((at.kept_r + depth) / -at.last_derivative, at.kept_r + depth + most);
}

// Takes a sample of a ray in doubt: true if it is inside.
bool enters(inout March at, float t, float r, float noise) {
    bool falling = at.last_derivative < 0.0;
    // the three samples in order
    vec2 first = vec2(at.t, at.r);
    vec2 middle = falling ? vec2(-at.kept_t, at.kept_r) : vec2(t, r);
    vec2 last = falling ? vec2(t, r) : vec2(-at.kept_t, at.kept_r);
    bool inside = r < -noise;
    bool falls = falling && last.y < middle.y;
    float fall = (first.y - middle.y) / (middle.x - first.x);
    float rise = (last.y - middle.y) / (last.x - middle.x);
    bool before = falls || fall > rise;  // the middle sample lies before the least value
    first = before ? middle : first;
    last = before ? last : middle;
    float rate = max(max(fall, rise), abs(at.last_derivative));
    float left = falling ? 6.0 : at.derivative - 1.0;
    bool over = !falls && (left == 0.0 || first.y + last.y - rate * (last.x - first.x) > -2.0 * noise);
    if (!inside && !over) {
        at.t = first.x;
        at.r = first.y;
        at.kept_t = -last.x;
        at.kept_r = last.y;
        if (!falls) at.last_derivative = rate;
        if (!falls) at.derivative = left;
        return false;
    }
    float slope = falling ? -rise : at.last_derivative;
    at.last_derivative = inside ? -slope : 0.0;
    at.derivative = clamp(rate, 0.0, 0.999);
    at.t = inside ? min(t, (falling ? middle.x + middle.y / slope : at.t + at.r / slope) - r / slope) : last.x;
    at.r = inside ? r : max(last.y, 0.0);
    at.kept_t = 0.0;
    at.refining = false;
    at.passing = true;
    return inside;
}
