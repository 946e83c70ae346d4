// The light of one source that a surface sends to the eye, after Phong: ambient, diffuse and highlight share the
// colour of the source.
// needs: Material
// gives: phong
vec3 phong(Material material, vec3 normal, vec3 view, vec3 light, vec3 radiance, float visibility) {
    float diffuse = max(dot(normal, light), 0.0);
    float highlight = diffuse > 0.0 ? max(dot(reflect(-light, normal), view), 0.0) : 0.0;
    float gloss = highlight > 0.0 ? pow(highlight, material.shininess) : 0.0;
    return radiance * (material.ambient * material.color
        + visibility * (diffuse * material.color + material.specular * gloss));
}
