// Sets the values of the frame.
void set_frame() {
$given
    $size = $extent;
    place_camera($position, $target, $up);
    u_pixel = 2.0 * $size / u_resolution.y;
    u_far = $far;
$moved
#ifdef LENS
    u_lens = vec2($aperture, $focus);
    u_far += u_lens.x;
$sharp
#endif
$clip
#ifndef OWN_START
#ifdef ANALYTIC
    float at_camera = ray_field(u_camera_position, true);
#else
    float at_camera = field(u_camera_position);
#endif
    u_side = at_camera < 0.0 ? -1.0 : 1.0;
#endif
#ifdef START
    vec3 size = abs(u_camera_position);
    float empty = abs(at_camera) * 0.999999 - 1.0e-6 * max(size.x, max(size.y, size.z));
    u_start = vec4(0.0, 0.0, 0.0, empty < 1.0e30 ? max(empty, 0.0) : 0.0);
#endif
}
