// Evaluations of the field and its gradient so far, by the kind of the ray.
vec4 evaluations_of_kinds = vec4(0.0);  // by camera rays, shadow rays, samples of ambient occlusion, bounces

void count_evaluation() {
    evaluations_of_kinds += vec4(equal(vec4(ray_kind), vec4(0.0, 1.0, 1.25, 2.0)));
}
