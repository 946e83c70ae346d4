// The hit of a pixel's ray, read from the march passes. A ray that is not finished is shown at its current position.
uniform sampler2D u_march;
uniform sampler2D u_found;

Hit trace(Ray ray) {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 march = texelFetch(u_march, pixel, 0);
    Hit hit = unpack_hit(march, texelFetch(u_found, pixel, 0));
    if (flag(march, 32.0)) {
        hit.done = false;
        hit.found = true;
        hit.t = march.x;
    }
    return hit;
}
