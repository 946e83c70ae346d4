// A ray of a Whitted ray tree.
struct Branch {
    Ray ray;
    float start;  // distance along the ray at which to begin
    vec3 weight;  // throughput to the camera
    vec3 absorption;  // of the glass around the ray
    float travelled;
    float side;  // -1 inside glass
    int bounce;  // number of bounces before it
#ifdef SHOWS
    bool refracted;  // or reflected inside glass: it shows lights
#endif
};
