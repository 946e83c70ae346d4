// Phong reflection of one light. The ambient, diffuse and specular terms all use the radiance of the light.
vec3 eval_phong(Surface surface, Light light, float visibility) {
    float diffuse = max(dot(surface.normal, light.direction), 0.0);
    float highlight = diffuse > 0.0 ? dot(reflect(-light.direction, surface.normal), surface.view) : 0.0;
    float gloss = highlight > 0.0 ? pow(highlight, surface.material.shininess) : 0.0;
    return light.radiance * (surface.material.ambient * surface.material.color
        + visibility * (diffuse * surface.material.color + surface.material.specular * gloss));
}
