// The field, with each node compared to its value at the previous evaluation.
float field(vec3 p) {
    float value = field_value(p);
    compare(p);
    return value;
}
