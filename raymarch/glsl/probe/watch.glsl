// The largest slopes of four nodes, from their values while rays are marched; each component of a vec4 belongs to one
// node. Each value is compared with the previous one of the same node, in the object space of the node. Where a node is
// evaluated several times for one value of the field, the last value counts. Two points closer than 2^-10 of their
// coordinates are not compared, because rounding would dominate; 16 half ulp of rounding are subtracted.
uniform int u_first;  // index of the first of the four nodes

vec4 now_x;  // last point at which each node was evaluated
vec4 now_y;
vec4 now_z;
vec4 now_value;  // its value there
vec4 now_cell;  // an index of the point's cell, for nodes that differ from cell to cell
vec4 before_x;
vec4 before_y;
vec4 before_z;
vec4 before_value;
vec4 before_cell;
vec4 slopes;
vec4 slope_place;  // of the first node: point, and distance between the samples

void watch() {
    now_x = now_y = now_z = now_value = vec4(0.0);
    before_x = before_y = before_z = before_value = vec4(0.0);
    now_cell = before_cell = vec4(-1.0e30);  // no cell has this index
    slopes = slope_place = vec4(0.0);
}

float record_value(float value, vec3 p, float cell, int node) {
    int component = finite(vec4(p, value)) ? node - u_first : -1;
    bvec4 own = equal(ivec4(component), ivec4(0, 1, 2, 3));
    now_x = mix(now_x, vec4(p.x), own);
    now_y = mix(now_y, vec4(p.y), own);
    now_z = mix(now_z, vec4(p.z), own);
    now_value = mix(now_value, vec4(value), own);
    now_cell = mix(now_cell, vec4(cell), own);
    return value;
}

// Compares the nodes' values in the evaluation of the field at p with their previous values.
void compare(vec3 p) {
    vec4 x = now_x - before_x;
    vec4 y = now_y - before_y;
    vec4 z = now_z - before_z;
    vec4 apart = sqrt(x * x + y * y + z * z);
    vec4 a = max(max(abs(now_x), abs(now_y)), max(abs(now_z), abs(now_value)));
    vec4 b = max(max(abs(before_x), abs(before_y)), max(abs(before_z), abs(before_value)));
    vec4 scale = max(a, b);
    bvec4 far = greaterThan(apart, 9.765625e-4 * scale);  // false where apart is 0: that quotient below is not used
    bvec4 alike = equal(now_cell, before_cell);
    vec4 slope = (abs(now_value - before_value) - 9.5367432e-7 * scale) / apart;
    slope = mix(vec4(0.0), mix(vec4(0.0), slope, alike), far);
    if (slope.x > slopes.x) slope_place = vec4(p, apart.x);
    slopes = mix(slopes, slope, greaterThan(slope, slopes));
    bvec4 moved = bvec4(mix(vec4(1.0), vec4(far), alike));
    before_x = mix(before_x, now_x, moved);
    before_y = mix(before_y, now_y, moved);
    before_z = mix(before_z, now_z, moved);
    before_value = mix(before_value, now_value, moved);
    before_cell = mix(before_cell, now_cell, moved);
}

vec4 steepest() {
    return slopes;
}

vec4 steepest_place() {
    return slope_place;
}
