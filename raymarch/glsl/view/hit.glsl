// Pass: the hit of each pixel's ray, for passes that add lights to its surface.
layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_found;

uniform vec2 u_jitter;  // offset from the pixel's centre, in pixels

void main() {
    Ray ray = camera_ray(gl_FragCoord.xy + u_jitter);
    March at;
    float far;
    vec2 spent;
    bool open = begins(ray, at, far, spent);
    Hit hit = no_hit(open ? at.t : 0.0);
    hit.iterations = spent.x;
    hit.evaluations = spent.y;
    if (open) march(ray, at, hit, far);
#ifdef ANALYTIC
    keep_solved(hit);
#endif
    out_march = packed_march(at, hit, false);
    out_found = packed_hit(hit);
}
