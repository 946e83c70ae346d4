// Fresnel reflectance after Schlick (1994). Powers are products: pow of a negative base is undefined, and rounding can
// make 1 - cosine negative.
float pow5(float x) {
    float square = x * x;
    return square * square * x;
}

vec3 fresnel_schlick(vec3 f0, float cosine) {
    return f0 + (1.0 - f0) * pow5(clamp(1.0 - cosine, 0.0, 1.0));
}
