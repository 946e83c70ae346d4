// By how much the surface is moved towards a ray: its tangent seen from the camera, or its length if rays are parallel.
// 0 marches to the surface itself.
const float EDGE_REACH = 0.7072;  // half the diagonal of a pixel, in pixels
float edge_width = 0.0;
