// Pass: the samples of the field along one ray. All pixels trace that ray, and each keeps another sample of it.
layout(location = 0) out vec4 out_sample;  // distance, how far the ray is free ahead, how far by the field alone, kind
layout(location = 1) out vec4 out_end;  // distance of the hit or -1, number of samples

uniform vec2 u_ray_pixel;  // the place in the picture that the ray goes through, in pixels

void main() {
    kept_number = int(gl_FragCoord.x) + int(gl_FragCoord.y) * int(u_resolution.x);
    Hit hit = trace(camera_ray(u_ray_pixel));
    out_sample = kept_sample;
    out_end = vec4(hit.found ? hit.t : -1.0, float(samples_taken), 0.0, 0.0);
}
