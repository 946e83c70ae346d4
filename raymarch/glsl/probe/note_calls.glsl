// The field, with faults noted at each evaluation.
float field(vec3 p) {
    note(field_faults(p), p);
    return field_value(p);
}
