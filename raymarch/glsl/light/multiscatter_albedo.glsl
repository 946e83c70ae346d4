// Directional albedo of multiple scattering between the microfacets of a metal (Kulla and Conty 2017). For white metal
// it is all the energy that single scattering loses.
vec3 multiscatter_albedo(Surface surface) {
    Material material = surface.material;
    float missing = mean_missing_albedo(material.roughness);
    vec3 mean = material.color + (1.0 - material.color) / 21.0;  // cosine-weighted mean of Schlick's reflectance
    vec3 further = mean * mean * (1.0 - missing) / (1.0 - mean * missing);
    return material.metalness * missing_albedo(dot(surface.normal, surface.view), material.roughness) * further;
}
