// The start of a march as published: at `near`, without knowledge of the field. The first step is plain.
March start_march(Ray ray, float near) {
    return March(near, 0.0, 0.0, 0.0, -1.0, 0.0, false, false);
}
