// A part of a picture: the lower left texel of this target in the whole picture of the level, and the coarser level.

uniform vec2 u_corner;
uniform vec2 u_carried_corner;  // the lower left texel of the coarser level's target in its whole picture
uniform vec2 u_carried_size;  // that whole picture
