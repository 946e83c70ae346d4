// Where the march of a pixel goes on: at the least distance of the coarser cones that it may lie in.
// A texel of the coarser level: distance up to which its cone is free (negative if to the end of the range), derivative of the
// field there, steps and evaluations up to there, these shared out among the cone's pixels.
// needs: March
// gives: carry_on u_carried u_carried_cell u_cell u_footprint
uniform sampler2D u_carried;
uniform vec2 u_carried_cell;  // size in pixels of the coarser level's cells; 0 if there is none
uniform vec2 u_cell;  // size in pixels of this level's cells
uniform vec2 u_footprint;  // half of the part of its cell that the rays of a cell come from, in pixels

// False if nothing can be met.
bool carry_on(inout March at, inout vec2 spent) {
    if (u_carried_cell.x == 0.0) return true;
    vec2 middle = gl_FragCoord.xy * u_cell;
    ivec2 last = textureSize(u_carried, 0) - 1;
    // a thousandth of a pixel inwards, so that rounding does not take in the neighbours of a cell that just fits
    ivec2 low = ivec2((middle - u_footprint + 0.001) / u_carried_cell);
    ivec2 high = clamp(ivec2((middle + u_footprint - 0.001) / u_carried_cell), low, last);
    float free = 1.0e30;
    for (int y = low.y; y <= high.y; y++) {
        for (int x = low.x; x <= high.x; x++) {
            vec4 cone = texelFetch(u_carried, ivec2(x, y), 0);
            if (cone.x >= 0.0 && cone.x < free) {
                free = cone.x;
                at.derivative = at.last_derivative = cone.y;
            }
            spent += cone.zw;
        }
    }
    spent /= float((high.x - low.x + 1) * (high.y - low.y + 1));
    at.t = max(at.t, free);
    return free < 1.0e30;
}
