// The field, whose nodes are compared with what they gave where it was asked before.
// needs: field_value compare
// gives: field
float field(vec3 p) {
    float value = field_value(p);
    compare(p);
    return value;
}
