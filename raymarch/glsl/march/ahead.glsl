// Steps as long as the ray is known to be free, see raymarch/sdf/advance: by the tangent of what is convex, and by
// the Lipschitz constant of the rest. No step is too long.
const float UNDONE = -1.0;

float step_length(March at, float far) {
    return at.r;
}

float averaged_derivative(float before, float derivative) {
    return derivative;
}
