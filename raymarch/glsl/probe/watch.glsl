// The steepest slope of four nodes at a time, from the values that they give while rays are marched; a component of each
// vec4 is a node's. Each value is compared with the one before of the same node, in the space in which the node is asked;
// where a node is asked several times for one value of the field, its last answer counts. Two that are so near that
// rounding would show, 2^-10 of their coordinates, are not compared; 16 half units in the last place are let through.
// needs: finite
// gives: seen compare watch steepest steepest_place u_first now_x now_y now_z now_value now_cell before_x before_y before_z before_value before_cell slopes slope_place
uniform int u_first;  // number of the first of the four nodes

vec4 now_x;  // where each was last asked
vec4 now_y;
vec4 now_z;
vec4 now_value;  // what it gave
vec4 now_cell;  // a number for the cell of the point, where nodes differ from cell to cell
vec4 before_x;
vec4 before_y;
vec4 before_z;
vec4 before_value;
vec4 before_cell;
vec4 slopes;
vec4 slope_place;  // of the first node: where, and how far apart the samples were

void watch() {
    now_x = now_y = now_z = now_value = vec4(0.0);
    before_x = before_y = before_z = before_value = vec4(0.0);
    now_cell = before_cell = vec4(-1.0e30);  // no cell's number
    slopes = slope_place = vec4(0.0);
}

float seen(float value, vec3 p, float cell, int node) {
    int component = finite(vec4(p, value)) ? node - u_first : -1;
    bvec4 own = equal(ivec4(component), ivec4(0, 1, 2, 3));
    now_x = mix(now_x, vec4(p.x), own);
    now_y = mix(now_y, vec4(p.y), own);
    now_z = mix(now_z, vec4(p.z), own);
    now_value = mix(now_value, vec4(value), own);
    now_cell = mix(now_cell, vec4(cell), own);
    return value;
}

// Compares what the nodes gave for the field at p with what they gave before.
void compare(vec3 p) {
    vec4 x = now_x - before_x;
    vec4 y = now_y - before_y;
    vec4 z = now_z - before_z;
    vec4 apart = sqrt(x * x + y * y + z * z);
    vec4 a = max(max(abs(now_x), abs(now_y)), max(abs(now_z), abs(now_value)));
    vec4 b = max(max(abs(before_x), abs(before_y)), max(abs(before_z), abs(before_value)));
    vec4 scale = max(a, b);
    bvec4 far = greaterThan(apart, 9.765625e-4 * scale);  // so never 0: what is divided by it below is left out
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
