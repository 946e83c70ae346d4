// The surface interaction of a hit.
struct Surface {
    vec3 p;
    vec3 normal;  // on the side of the camera
    vec3 view;  // towards the camera
    float t;  // distance from the camera along the ray
    Material material;
};
