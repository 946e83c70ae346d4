// A way of light that is yet to be followed, in a tree of them. GLSL has no recursion; the ways wait in an array.
// needs: Ray
// gives: Branch
struct Branch {
    Ray ray;
    float start;  // where on the ray to begin
    vec3 weight;  // share of what it brings that reaches the eye
    vec3 absorption;  // of the glass that it is in
    float travelled;
    float side;  // -1 inside of glass
    int bounce;  // surfaces before it, beyond the first
};
