// The surface interaction of a hit.
struct Surface {
    vec3 p;
    vec3 normal;  // of shading, on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
    float ambient_visibility;  // from the material's occlusion, 0 to 1
    vec3 geometric_normal;  // normal of the solid, without normal mapping
    vec3 dpdx;  // the pixel's footprint on the surface: axes of an ellipse
    vec3 dpdy;
    vec3 inner;  // just inside the solid, where materials are evaluated
};
