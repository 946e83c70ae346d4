// A ray is marched from the camera to the far end.
// needs: Ray Hit march
// gives: trace u_far
uniform float u_far;

Hit trace(Ray ray) {
    return march(ray, 0.0, u_far);
}
