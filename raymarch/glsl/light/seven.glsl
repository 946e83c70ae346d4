// Seven rays to a disc of radius 1: to its middle and to a hexagon. How free one is, without a step where it meets a
// solid, which is at a clearance of 0.02; its share: from 0 to 2/7 for the middle, to 5/42 for each other ray.
vec2 ray_of_seven(int i) {
    float turn = 1.0471976 * float(i);
    return i == 0 ? vec2(0.0) : 0.92 * vec2(cos(turn), sin(turn));
}

float free_of_seven(float clear) {
    return max(clear - 0.02, 0.0) / 0.98;
}

float share_of_seven(int i, float free) {
    return max(2.0 * beside_edge(free) - 1.0, 0.0) * (i == 0 ? 2.0 / 7.0 : 5.0 / 42.0);
}
