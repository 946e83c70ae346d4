// The field, with faults noted at each evaluation.
// needs: field_value field_faults note
// gives: field
float field(vec3 p) {
    note(field_faults(p), p);
    return field_value(p);
}
