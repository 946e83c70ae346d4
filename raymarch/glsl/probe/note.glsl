// The first fault of a pixel: its code, its value, the number of evaluations with a fault, and its position. Faults of
// nodes whose bit in u_site_mask is 0 are ignored.
uniform uint u_site_mask[128];

vec3 first_fault = vec3(0.0);
vec3 first_place = vec3(0.0);

void note(vec2 fault, vec3 p) {
    if (fault.x <= 0.0) return;
    int site = min(int(fault.x) / 32, 4095);
    if ((u_site_mask[site >> 5] >> uint(site & 31) & 1u) == 0u) return;
    if (first_fault.z == 0.0) {
        first_fault.xy = fault;
        first_place = p;
    }
    first_fault.z += 1.0;
}

vec3 noted() {
    return first_fault;
}

vec3 noted_place() {
    return first_place;
}
