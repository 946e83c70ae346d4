// Some pixels of a picture: every `u_grid_stride`-th in each direction.
uniform vec2 u_grid_stride;
uniform vec2 u_grid_corner;  // where the corner of the first one's target would be in the picture, in pixels
