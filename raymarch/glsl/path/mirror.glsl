// What a tree of ways follows of a surface's reflection: all of it where it is smooth, up to a roughness of 0.1, nothing
// from 0.2 on; and its weight, after Schlick.
// needs: Surface Material fresnel
// gives: followed_of mirrored_by
float followed_of(Material material) {
    return clamp(2.0 - 10.0 * material.roughness, 0.0, 1.0);
}

vec3 mirrored_by(Surface surface) {
    vec3 f0 = mix(surface.material.f0, surface.material.color, surface.material.metalness);
    return fresnel(f0, dot(surface.normal, surface.view));
}
