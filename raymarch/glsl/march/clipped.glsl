// A ray is marched only where it is inside the scene's box; outside there is nothing to hit.
// needs: Ray scene_box
// gives: range_of u_far
uniform float u_far;

vec2 range_of(Ray ray) {
    return scene_box(ray, vec2(0.0, u_far));
}
