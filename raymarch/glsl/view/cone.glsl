// Pass: how far the cones around the rays of each cell of pixels are empty. See march/carry for the texels.
layout(location = 0) out vec4 out_state;

void main() {
    Ray ray = camera_ray(PIXEL * u_cell);
    vec2 range = range_of(ray);
    March at = start_march(ray, range.x);
#ifndef OWN_START
    at.r /= 1.0 + u_cone;
    at.derivative = (at.derivative - u_cone) / (1.0 + u_cone);
#endif
    vec2 spent = vec2(0.0);
    bool open = range.x <= range.y && carry_on(at, spent) && at.t <= range.y;
    if (open) {
#ifdef OWN_START
        enter(ray, at);
#ifdef WIDE_CONE
        at.r -= u_cone_start;
#endif
        at.r = max((at.r - u_cone * at.t) / (1.0 + u_cone), 0.0);
        spent.y += 1.0 / (u_cell.x * u_cell.y);
#endif
        Hit hit = no_hit(0.0);
#ifdef STRETCH
        begin_stretch(range.y - at.t);
#endif
        march(ray, at, hit, range.y);
        spent += vec2(hit.iterations, hit.evaluations / (u_cell.x * u_cell.y));
        open = hit.found || at.t + at.r <= range.y;
    }
    // of the field itself, from the derivative of a cone's safe step
    float derivative = at.derivative * (1.0 + u_cone) + u_cone;
    out_state = vec4(open ? max(at.t + at.r, 0.0) : -1.0, at.derivative > -1.0 ? derivative : -1.0, spent);
}
