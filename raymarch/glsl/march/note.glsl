// Keeps one sample of a march, by its number, for the figure of a ray; see view/ray.
int kept_number;  // of the sample that is kept; the first is 0
int samples_taken = 0;
vec4 kept_sample = vec4(-1.0);  // distance, how far the ray is free ahead, how far by the field alone, kind

// What becomes of a sample.
const float SEARCHES = 0.0;
const float REFINES = 1.0;
const float IS_UNDONE = 2.0;
const float STARTS = 3.0;

void note_sample(float t, float ahead, float behind, float kind) {
    if (samples_taken == kept_number) kept_sample = vec4(t, ahead, behind, kind);
    samples_taken++;
}

// The kind of the last sample, which is known only once it is compared with the one before.
void note_kind(float kind) {
    if (samples_taken - 1 == kept_number) kept_sample.w = kind;
}
