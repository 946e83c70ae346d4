// What maps add to a surface: what is taken off its unit normal, and the share of ambient light that comes through.
// needs:
// gives: Relief
struct Relief {
    vec3 tilt;
    float open;
};
