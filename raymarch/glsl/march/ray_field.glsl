// The field that a ray is marched through: that of the marched solids; of all solids for a ray inside of one.
float ray_field(vec3 p, bool inside) {
    float r = marched_field(p);
    if (inside) r = min(r, solved_field(p));
    return r;
}
