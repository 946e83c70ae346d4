// A ray is marched only where it is inside the scene's box; outside there is nothing to hit.
// needs: Ray Hit missed march scene_box
// gives: trace u_far
uniform float u_far;

Hit trace(Ray ray) {
    vec2 range = scene_box(ray, vec2(0.0, u_far));
    if (range.x > range.y) return missed(0.0);
    return march(ray, range.x, range.y);
}
