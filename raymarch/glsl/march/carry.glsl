// The start of the march of a pixel: the least distance of the coarser cones that may contain its ray. A texel of the
// coarser level holds the distance up to which its cone is empty (negative if it is empty to the end of the range), the
// derivative of the field there, and the steps and evaluations so far, divided by the cone's number of pixels.
uniform sampler2D u_carried;
uniform vec2 u_carried_cell;  // cell size of the coarser level in pixels; 0 if there is none
uniform vec2 u_cell;  // cell size of this level in pixels
uniform vec2 u_footprint;  // half the size of the region of a cell that its rays go through, in pixels

// False if the ray hits nothing.
bool carry_on(inout March at, inout vec2 spent) {
    if (u_carried_cell.x == 0.0) return true;
    vec2 middle = PIXEL * u_cell;
#ifdef PART
    ivec2 last = ivec2(u_carried_size) - 1;
#else
    ivec2 last = textureSize(u_carried, 0) - 1;
#endif
    // a thousandth of a pixel inwards, so that rounding does not add neighbours of a cell that fits exactly
    ivec2 low = ivec2((middle - u_footprint + 0.001) / u_carried_cell);
    ivec2 high = clamp(ivec2((middle + u_footprint - 0.001) / u_carried_cell), low, last);
    float free = 1.0e30;
    for (int y = low.y; y <= high.y; y++) {
        for (int x = low.x; x <= high.x; x++) {
#ifdef PART
            vec4 cone = texelFetch(u_carried, ivec2(x, y) - ivec2(u_carried_corner), 0);
#else
            vec4 cone = texelFetch(u_carried, ivec2(x, y), 0);
#endif
            if (cone.x >= 0.0 && cone.x < free) {
                free = cone.x;
                at.derivative = cone.y;
            }
            spent += cone.zw;
        }
    }
    spent /= float((high.x - low.x + 1) * (high.y - low.y + 1));
    if (free > at.t) {
        at.t = free;
        at.r = 0.0;
    }
    return free < 1.0e30;
}
