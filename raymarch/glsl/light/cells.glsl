// The lights that reach a point, from a grid of cells; see raymarch/plan/light_cells.py.
uniform sampler2D u_light_cells;

vec4 light_cell(int texel) {
    int width = textureSize(u_light_cells, 0).x;
    return texelFetch(u_light_cells, ivec2(texel % width, texel / width), 0);
}

// The start and the length of the list of a point.
ivec2 lights_at(vec3 p) {
    vec4 grid = light_cell(0);
    vec3 counts = light_cell(1).xyz;
    vec3 cell = floor((p - grid.xyz) * grid.w);
    bool inside = all(greaterThanEqual(cell, vec3(0.0))) && all(lessThan(cell, counts));
    int texel = inside ? 3 + int(cell.x + counts.x * (cell.y + counts.y * cell.z)) : 2;
    return ivec2(light_cell(texel).xy);
}

// The number of a light in a list.
int light_of(int texel) {
    return int(light_cell(texel).x);
}
