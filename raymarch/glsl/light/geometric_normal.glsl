// The geometric normal, on the side of the shading normal.
vec3 geometric_normal(Surface surface) {
#ifdef RELIEF
    return dot(surface.normal, surface.geometric_normal) < 0.0 ? -surface.geometric_normal : surface.geometric_normal;
#else
    return surface.normal;
#endif
}
