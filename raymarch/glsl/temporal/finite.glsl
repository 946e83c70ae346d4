// True if no component is NaN or infinite. Compilers may turn `not less` into `greater or equal`, which lets NaN pass.
bool finite(vec4 v) {
    return all(lessThan(floatBitsToUint(v) & 0x7F800000u, uvec4(0x7F800000u)));
}
