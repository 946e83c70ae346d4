// The field, looked at wherever it is asked.
// needs: field_value field_faults note
// gives: field
float field(vec3 p) {
    note(field_faults(p), p);
    return field_value(p);
}
