// Whether a context really draws: x² + 1 for each column.
out uvec4 square;

void main() {
    uint x = uint(gl_FragCoord.x);
    square = uvec4(x * x + 1u, 0u, 0u, 1u);
}
