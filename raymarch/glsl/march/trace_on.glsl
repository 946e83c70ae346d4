// What the ray of a pixel hits, marched on from where the cones that hold it ended.
// needs: Ray Hit March begun missed march range_of carry_on
// gives: trace u_spent
uniform float u_spent;  // 1, or 0 if the cones were kept from an earlier frame

Hit trace(Ray ray) {
    vec2 range = range_of(ray);
    if (range.x > range.y) return missed(0.0);
    March at = begun(range.x);
    vec2 spent = vec2(0.0);
    bool open = carry_on(at, spent);
    Hit hit = missed(range.y);
    if (open && at.t <= range.y) hit = march(ray, at, range.y);
    hit.iterations += u_spent * spent.x;
    hit.evaluations += u_spent * spent.y;
    return hit;
}
