// One pass of a picture, to be blended into the running mean of its passes; SCALED: what a picture of another size has
// at the same place; BRIDGED: what lies between two rows.
uniform sampler2D pass;
#ifdef SCALED
uniform vec3 whole; // what is drawn into: width, height, pixels
#endif
#ifdef BRIDGED
uniform vec3 gap; // rows around it
#endif
out vec4 film;

void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
#if defined(SCALED)
    film = texture(pass, gl_FragCoord.xy / whole.xy);
#elif defined(BRIDGED)
    vec4 above = texelFetch(pass, ivec2(pixel.x, int(gap.x)), 0), below = texelFetch(pass, ivec2(pixel.x, int(gap.y)), 0);
    // Both rows may be the same one.
    film = mix(above, below, (float(pixel.y) - gap.x) / max(gap.y - gap.x, 1.0));
#else
    film = texelFetch(pass, pixel, 0);
#endif
}
