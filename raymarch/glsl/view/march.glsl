// Pass: some more steps of each ray that is still on its way.
// needs: Ray Hit March camera_ray range_of begins march missed exhausted max_steps packed_march packed_hit unpack_march unpack_hit u_march u_found
// gives: main out_march out_found u_begin
layout(location = 0) out vec4 out_march;
layout(location = 1) out vec4 out_found;

uniform bool u_begin;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    Ray ray = camera_ray(gl_FragCoord.xy);
    March at;
    Hit hit = missed(0.0);
    float far;
    if (u_begin) {
        vec2 spent;
        hit.done = !begins(ray, at, far, spent);
        hit.iterations = spent.x;
        hit.evaluations = spent.y;
    } else {
        vec4 before = texelFetch(u_march, pixel, 0);
        at = unpack_march(before);
        hit = unpack_hit(before, texelFetch(u_found, pixel, 0));
        far = range_of(ray).y;
    }
    if (!hit.done) {
        Hit more = march(ray, at, far);
        // what came nearest in all passes, as seen from the camera
        if (!more.done && !u_begin && hit.residual * more.t < more.residual * hit.t) {
            more.t = hit.t;
            more.residual = hit.residual;
        }
        more.iterations += hit.iterations;
        more.evaluations += hit.evaluations;
        more.fallbacks += hit.fallbacks;
        hit = more;
        if (!hit.done && hit.iterations >= float(max_steps)) {
            exhausted(hit);
            hit.done = true;
        }
    }
    out_march = packed_march(at, hit);
    out_found = packed_hit(hit);
}
