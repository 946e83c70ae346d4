// Pass: some more steps of each ray that is not finished.
layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_found;
layout(location = 2) out vec4 out_more;

uniform sampler2D u_more;
uniform bool u_begin;
uniform bool u_end;  // the last pass: unfinished rays stop

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Ray ray = camera_ray(PIXEL);
    March at;
    Hit hit;
    vec2 range;
    bool under_way;
    if (u_begin) {
        hit = no_hit(0.0);
        under_way = begins(ray, hit, at, range);
    } else {
        vec4 before = texelFetch(u_march, pixel, 0);
        at = unpack_march(before, texelFetch(u_more, pixel, 0));
        hit = unpack_hit(before, texelFetch(u_found, pixel, 0));
        range = range_of(ray);
        under_way = flag(before, 32.0);
    }
    if (under_way) {
        march(ray, at, hit, range.y);
        under_way = !hit.done && !u_end;
    }
#ifdef ANALYTIC
    if (!under_way) keep_solved(hit);
#endif
    out_march = packed_march(at, hit, under_way);
    out_found = packed_hit(hit);
    out_more = packed_more(at);
}
