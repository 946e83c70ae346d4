// The size of the cones of a pass: at t the points of a cone lie within u_cone t of its axis.
uniform float u_cone;
#ifdef WIDE_CONE
uniform float u_cone_start;  // and of a cone whose rays start apart, this much farther
#endif
