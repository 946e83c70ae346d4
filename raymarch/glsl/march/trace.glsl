// What the ray of a pixel hits, marched in one go.
// needs: Ray Hit March begun missed march range_of
// gives: trace
Hit trace(Ray ray) {
    vec2 range = range_of(ray);
    if (range.x > range.y) return missed(0.0);
    March at = begun(range.x);
    Hit hit = missed(at.t);
    march(ray, at, hit, range.y);
    return hit;
}
