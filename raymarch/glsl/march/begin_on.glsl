// Where the march of a pixel's ray begins and ends: where the cones that hold it ended, at the cost that they had; false
// if there is nothing to meet.
// needs: Ray March start_march range_of carry_on
// gives: begins u_spent
uniform float u_spent;  // 1, or 0 if the cones were kept from an earlier frame

bool begins(Ray ray, out March at, out float far, out vec2 spent) {
    vec2 range = range_of(ray);
    at = start_march(range.x);
    far = range.y;
    spent = vec2(0.0);
    bool open = range.x <= range.y && carry_on(at, spent) && at.t <= range.y;
    spent *= u_spent;
    return open;
}
