// A mark of a soft light: 24 bits for the points of its disc that are hidden, and 8 for how far apart on screen the
// shadows of two such points are, set from the lowest on, so that the largest is left where several meet.
float step_between(float step_at_metre, float height, float w) {
    return step_at_metre * max(height, 0.0) / max(w, 1e-6);
}

uint mark_of(uint points, float pixels) {
    int octaves = clamp(int(1.5 * log2(max(pixels, 1e-3)) + 1.5), 0, 8);
    return points | (0xFF0000u << octaves & 0xFF000000u);
}
