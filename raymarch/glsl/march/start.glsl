// The start of a march: in the sphere around the camera that is known to be empty, or at `near` beyond it. The expected
// derivative is biased towards -1, because a step that is undone costs more than a short one.
uniform vec4 u_start;  // at the camera, times u_side: gradient and value of the field; 0 if they are not known

March start_march(Ray ray, float near) {
    if (u_start.w <= near) return March(near, 0.0, 0.0, 0.0, -0.7, 0.0, false, false);
    float derivative = clamp(dot(u_start.xyz, ray.direction), -1.0, 1.0);
    return March(0.0, u_start.w, 0.0, 0.0, mix(-1.0, derivative, 0.3), 0.0, false, false);
}
