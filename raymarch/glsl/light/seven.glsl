// Seven rays to a disc of radius 1: to its middle and to a hexagon. The share of one that has a clearance, from 0 to 1.
vec2 ray_of_seven(int i) {
    float turn = 1.0471976 * float(i);
    return i == 0 ? vec2(0.0) : 0.92 * vec2(cos(turn), sin(turn));
}

float share_of_seven(float clear) {
    return max(2.0 * beside_edge(clear) - 1.0, 0.0) / 7.0;
}
