// One pass of a picture, to be blended into the running mean of its passes.
uniform sampler2D pass;
out vec4 film;

void main() {
    film = texelFetch(pass, ivec2(gl_FragCoord.xy), 0);
}
