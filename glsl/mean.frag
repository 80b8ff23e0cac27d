// One pass of a picture, to be blended into the running mean of its passes; SCALED: what a picture of another size has
// at the same place.
uniform sampler2D pass;
#ifdef SCALED
uniform vec3 whole; // what is drawn into: width, height, pixels
#endif
out vec4 film;

void main() {
#ifdef SCALED
    film = texture(pass, gl_FragCoord.xy / whole.xy);
#else
    film = texelFetch(pass, ivec2(gl_FragCoord.xy), 0);
#endif
}
