// The surface interaction of a hit, for materials that depend on the point.
struct Surface {
    vec3 p;
    vec3 normal;  // on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
    vec3 inner;  // just inside the solid, where materials are evaluated
};
