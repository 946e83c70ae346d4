// A basic sphere tracer, as written by hand: a box minus a sphere, a torus blended with a sphere, and a floor up to the
// horizon; a sun with a hard shadow, normals from four samples. The alpha channel is the distance, -1 without a hit.
uniform vec2 resolution;
layout(location = 0) out vec4 color;

#ifndef EPSILON
#define EPSILON 0.0001 * t
#endif
const int STEPS = 512;
const float FAR = 20000.0;
const vec3 SUN = normalize(vec3(0.5, 1.0, 0.7));

float box(vec3 p, vec3 b) {
    vec3 q = abs(p) - b;
    return length(max(q, 0.0)) + min(max(q.x, max(q.y, q.z)), 0.0);
}

float sphere(vec3 p, float r) {
    return length(p) - r;
}

float torus(vec3 p, float major, float minor) {
    return length(vec2(length(p.xz) - major, p.y)) - minor;
}

float smooth_min(float a, float b, float k) {
    float h = max(k - abs(a - b), 0.0) / k;
    return min(a, b) - 0.25 * h * h * k;
}

const float C = cos(1.1);
const float S = sin(1.1);

float map(vec3 p) {
    vec3 a = p - vec3(-1.3, 0.0, 0.0);
    vec3 b = p - vec3(1.3, 0.2, 0.0);
    b.yz = vec2(C * b.y + S * b.z, C * b.z - S * b.y);
    float cut = max(box(a, vec3(0.8)), -sphere(a, 1.0));
    float ring = smooth_min(torus(b, 0.8, 0.3), sphere(b, 0.6), 0.3);
    return min(min(cut, ring), p.y + 0.9);
}

vec3 normal(vec3 p) {
    const vec2 e = vec2(1.0, -1.0) * 0.0005;
    return normalize(e.xyy * map(p + e.xyy) + e.yyx * map(p + e.yyx) + e.yxy * map(p + e.yxy) + e.xxx * map(p + e.xxx));
}

float shadow(vec3 p, vec3 direction) {
    float t = 0.01;
    for (int i = 0; i < 128; i++) {
        float h = map(p + t * direction);
        if (h < 0.0005) return 0.0;
        t += h;
        if (t > 20.0) break;
    }
    return 1.0;
}

void main() {
    vec3 eye = vec3(1.5, 2.5, 6.5);
    vec3 backward = normalize(eye);
    vec3 right = normalize(cross(vec3(0.0, 1.0, 0.0), backward));
    vec3 up = cross(backward, right);
    vec2 screen = (2.0 * gl_FragCoord.xy - resolution) / resolution.y * tan(radians(25.0));
    vec3 direction = normalize(screen.x * right + screen.y * up - backward);

    float t = 0.0;
    bool hit = false;
    for (int i = 0; i < STEPS && t < FAR; i++) {
        float h = map(eye + t * direction);
        if (h < EPSILON) {
            hit = true;
            break;
        }
        t += h;
    }
    color = vec4(0.5, 0.65, 0.85, -1.0);
    if (!hit) return;
    vec3 p = eye + t * direction;
    vec3 n = normal(p);
    float lit = max(dot(n, SUN), 0.0);
    if (lit > 0.0) lit *= shadow(p + 0.002 * n, SUN);
    float shine = lit > 0.0 ? pow(max(dot(reflect(direction, n), SUN), 0.0), 32.0) : 0.0;
    color = vec4(0.5 * (0.1 + lit) + 0.25 * shine, 0.5 * (0.1 + lit) + 0.25 * shine, 0.5 * (0.1 + lit) + 0.25 * shine, t);
}
