// The smallest range that holds two. An empty range ends before it starts.
vec2 enclosing(vec2 a, vec2 b) {
    return b.x <= b.y ? vec2(min(a.x, b.x), max(a.y, b.y)) : a;
}
