// The share of even light that leaves a metal after several of its facets have mirrored it, one after the other (Kulla and
// Conty 2017). White metal gives back all that one reflection keeps.
// needs: Surface Material missing_albedo mean_missing_albedo
// gives: multiscatter_albedo
vec3 multiscatter_albedo(Surface surface) {
    Material material = surface.material;
    float missing = mean_missing_albedo(material.roughness);
    vec3 mean = material.color + (1.0 - material.color) / 21.0;  // of Schlick's reflectance
    vec3 further = mean * mean * (1.0 - missing) / (1.0 - mean * missing);
    return material.metalness * missing_albedo(dot(surface.normal, surface.view), material.roughness) * further;
}
