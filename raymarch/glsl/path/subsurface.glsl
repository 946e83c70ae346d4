// A uniform random direction of the unit sphere.
vec3 random_direction(int dimension) {
    float z = 2.0 * random_of_pixel(dimension) - 1.0;
    float turn = 6.2831853 * random_of_pixel(dimension + 1);
    return vec3(sqrt(1.0 - z * z) * vec2(cos(turn), sin(turn)), z);
}

// Most scatterings and leaps of a walk. On average a walk in a white medium takes 15 to 20.
const int scattering_turns = 128;

// Free distances, in mean free paths, from which a walk leaps.
const float leap_from = 4.0;

// The same for colours that leap while others do not: the walk goes on with these, or with the others.
const float split_from = 12.0;

// Light in a medium that scatters it.
struct Walk {
    vec3 color;  // albedo of a half-space
    vec3 albedo;  // of one scattering
    vec3 radius;  // mean free path of each colour
    vec3 weight;  // throughput to the camera
};

// A random walk in a solid from a surface, whose outward normal is given, to where it leaves the solid: `ray` and `hit`
// are then its last part. Returns false if nothing leaves.
//
// The field tells how far a point is from all surfaces. Where that is many mean free paths, the walk leaps to a random
// point of the ball that is free (Muller 1956): of light that diffuses, x / sinh(x) arrives there, x being the radius
// times sqrt(3 (1 - albedo)) / mean free path. Where the mean free path is below the precision of hits, light leaves
// where it entered. The free paths of all colours are drawn from one, chosen by the weights (Chiang et al. 2016).
bool walk_below(inout Walk walk, vec3 p, vec3 normal, float travelled, int dimension, inout Ray ray, inout Hit hit) {
    float longest = max(max(walk.radius.r, walk.radius.g), walk.radius.b);
    if (longest <= 2.0 * spawn_offset(p, travelled)) {
        walk.weight *= walk.color;
        return true;
    }
    vec3 radius = max(walk.radius, 1.0e-3 * longest);
    vec3 diffusion = sqrt(3.0 * (1.0 - walk.albedo)) / radius;
    float start;
    Ray way = spawn_ray(p, -normal, normalize(0.9999 * random_direction(dimension) - normal), travelled, start);
    for (int i = 0; i < scattering_turns; i++) {
        int numbers = dimension + 8 * i + 2;
        float free = -u_side * field(way.origin);
        vec3 chance = walk.weight / max(walk.weight.r + walk.weight.g + walk.weight.b, 1.0e-30);
        vec3 carried = radius * step(1.0e-20, walk.weight);
        bool all_leap = free > leap_from * max(max(carried.r, carried.g), carried.b);
        vec3 leaps = step(radius * (all_leap ? 0.0 : split_from), vec3(free));
        float leap = dot(chance, leaps);
        float choice = random_of_pixel(numbers);
        if (choice < leap) {
            vec3 x = max(diffusion * free, 1.0e-3);
            walk.weight *= 2.0 * x * exp(-x) / (1.0 - exp(-2.0 * x)) * leaps / leap;
            way.origin += free * random_direction(numbers + 2);
        } else {
            choice = (choice - leap) / (1.0 - leap);
            walk.weight *= (1.0 - leaps) / (1.0 - leap);
            chance *= (1.0 - leaps) / (1.0 - leap);
            float mean = choice < chance.r ? radius.r : choice < chance.r + chance.g ? radius.g : radius.b;
            float path = -mean * log(1.0 - random_of_pixel(numbers + 1));
            bool leaves = false;
            if (free < path) {
                hit = trace_secondary(way, start, travelled, -1.0);
                leaves = hit.found && hit.t <= path;
                if (leaves) path = hit.t;
            }
            vec3 passed = exp(-path / radius);
            if (leaves) {
                walk.weight *= passed / max(dot(chance, passed), 1.0e-30);
                ray = way;
                return true;
            }
            vec3 scattered = passed / radius;
            walk.weight *= walk.albedo * scattered / max(dot(chance, scattered), 1.0e-30);
            way.origin += path * way.direction;
        }
        way.direction = random_direction(numbers + 4);
        start = 0.0;
        float left = max(max(walk.weight.r, walk.weight.g), walk.weight.b);
        if (left < 0.1) {  // Russian roulette
            if (random_of_pixel(numbers + 6) > 10.0 * left) return false;
            walk.weight *= 0.1 / left;
        }
    }
    return false;
}
