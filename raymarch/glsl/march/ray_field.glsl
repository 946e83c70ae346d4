// The field that a ray is marched through: that of the marched solids, or of all solids for a ray that is inside of one.
// A loop stands for the branch, because software renderers execute both sides of a branch, but leave a loop early.
const int BRANCH = 256;  // more turns than a compiler unrolls

float ray_field(vec3 p, bool inside) {
    float r = marched_field(p);
    for (int i = 0; i < BRANCH && inside; i++) {
        r = min(r, solved_field(p));
        inside = false;
    }
    return r;
}
