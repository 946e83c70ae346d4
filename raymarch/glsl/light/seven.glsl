// Seven rays to a disc of radius 1: to its middle and to a hexagon. How free one is, without a step where it meets a
// solid, which is at a clearance of 0.02; its share: from 0 to 2/7 for the middle, to 5/42 for each other ray.
// 24 more go to a spiral by the golden angle (Vogel 1979), each for as much of the disc.
vec2 ray_of_disc(int i) {
    float turn = i < 7 ? 1.0471976 * float(i) : 2.399963 * (float(i) - 6.7);
    float far = i < 7 ? min(float(i), 0.92) : 0.95 * sqrt((float(i) - 6.7) / 24.0);
    return far * vec2(cos(turn), sin(turn));
}

float free_of_seven(float clear) {
    return max(clear - 0.02, 0.0) / 0.98;
}

float share_of_seven(int i, float free) {
    return max(2.0 * beside_edge(free) - 1.0, 0.0) * (i == 0 ? 2.0 / 7.0 : 5.0 / 42.0);
}

// How far a ray of the 24 counts, from 0 to 1: in full from a clearance of 1 on, which is 0.15 of the disc's radius.
float seen_of_disc(float clear) {
    return max(2.0 * beside_edge(clear) - 1.0, 0.0);
}

// How far seven rays are too few, from 0 to 1. `off`: how far the six are off those beside a straight edge, in sum. Few
// of these are free if there is a gap, and those of one side. Or none is, where the middle is not deep in a solid. A
// rod that hides the middle leaves both sides free.
float few_of_seven(float middle, float off, float sum, float sided) {
    float both = 1.0 - smoothstep(0.55, 0.85, sided / max(0.92 * sum, 0.02));
    float rod = both * (1.0 - smoothstep(-0.5, 0.0, middle));
    float gap = smoothstep(0.8, 1.6, off) * (1.0 - smoothstep(1.5, 2.5, sum)) * (1.0 - rod);
    float hidden = (1.0 - smoothstep(0.0, 0.1, sum)) * (1.0 - smoothstep(0.05, 0.2, abs(middle)));
    return max(gap, hidden) * (1.0 - smoothstep(0.8, 0.95, abs(middle)));
}
