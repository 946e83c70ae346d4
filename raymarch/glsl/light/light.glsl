// A light sample: the light of one source at a point of a surface.
struct Light {
    vec3 direction;  // towards the light
    float distance;
    vec3 radiance;  // reflected by a white diffuse surface that faces the light; 0 out of its range
};
