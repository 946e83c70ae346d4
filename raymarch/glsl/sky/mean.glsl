// The cosine-weighted mean radiance of the sky over the hemisphere about a direction: nine spherical harmonics
// (Ramamoorthi and Hanrahan 2001), whose coefficients include the cosine lobe.
uniform vec3 u_sky_light[9];

vec3 sky_mean(vec3 n) {
    vec3 first = u_sky_light[0] + 1.7320508 * (u_sky_light[1] * n.x + u_sky_light[2] * n.y + u_sky_light[3] * n.z);
    vec3 mixed = u_sky_light[4] * n.x * n.y + u_sky_light[5] * n.y * n.z + u_sky_light[6] * n.z * n.x;
    vec3 even = u_sky_light[7] * (3.0 * n.y * n.y - 1.0) * 1.1180340 + u_sky_light[8] * (n.x * n.x - n.z * n.z) * 1.9364917;
    return max(first + 3.8729833 * mixed + even, 0.0);
}
