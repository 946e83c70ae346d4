// Ambient occlusion from samples of the field along the normal: 1 where the field rises as over a plane, less near
// other surfaces.
float ambient_occlusion(Surface surface) {
    float reach = occlusion_reach();
    float decay = occlusion_decay();
    float missing = 0.0;
    float weights = 0.0;
    float weight = 1.0;
    for (int i = 0; i < occlusion_steps; i++) {
        float far = reach * (float(i) + 1.0) / float(occlusion_steps);
        float r = u_side * field(surface.p + far * surface.normal);
        missing += weight * clamp(1.0 - r / far, 0.0, 1.0);
        weights += weight;
        weight *= decay;
    }
    return clamp(1.0 - occlusion_strength() * missing / weights, 0.0, 1.0);
}
