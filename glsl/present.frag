// The picture in the window: exposure, tone map, the split between two pictures, and their difference in false colours.
uniform sampler2D left;
uniform sampler2D right;
uniform vec3 corner; // lower left corner of the picture, pixels of the window; then: column of the divider
uniform vec3 size; // of the picture, pixels; then: 2^EV
uniform vec3 options; // 1: two pictures, 2: their difference; tone map; 0
out vec4 color;

// IEC 61966-2-1, as film/mod.rs makes it for PNGs.
vec3 display_value(vec3 linear) {
    vec3 x = clamp(max(linear, 0.0), 0.0, 1.0);
    return mix(1.055 * pow(x, vec3(1.0 / 2.4)) - 0.055, 12.92 * x, lessThanEqual(x, vec3(0.0031308)));
}

vec3 tone_mapped(vec3 radiance) {
    int curve = int(options.y);
    vec3 x = max(radiance * size.z, 0.0);
    if (curve == 1) {
        x = x / (1.0 + x); // Reinhard et al. 2002, each channel alone
    } else if (curve == 2) {
        x = (x * (2.51 * x + 0.03)) / (x * (2.43 * x + 0.59) + 0.14); // ACES as fitted by Narkowicz (2015)
    }
    return display_value(x);
}

// Radiance at a point of the picture, (0, 0) its top left; pixels as they are where the picture fits the window.
vec3 radiance(sampler2D film, vec2 point) {
    ivec2 texels = textureSize(film, 0);
    if (texels == ivec2(size.xy)) {
        return texelFetch(film, ivec2(point * size.xy), 0).rgb;
    }
    return texture(film, point).rgb;
}

// As film/heat_map.rs: matplotlib's inferno, fitted by M. Zucker (2019, public domain), 10⁻⁶ to 1.
vec3 heat(vec3 a, vec3 b) {
    vec3 apart = abs(a - b);
    float difference = max(apart.r, max(apart.g, apart.b));
    float t = clamp(1.0 + log(max(difference, 1e-30)) / log(10.0) / 6.0, 0.0, 1.0);
    if (t == 0.0) {
        return vec3(0.0);
    }
    vec3 c = vec3(25.1311, -12.2427, -23.0703);
    c = c * t + vec3(-71.3194, 32.6261, 73.2095);
    c = c * t + vec3(77.1629, -33.4024, -81.8073);
    c = c * t + vec3(-41.704, 17.4364, 44.3541);
    c = c * t + vec3(11.6025, -3.9729, -15.9424);
    c = c * t + vec3(0.1065, 0.564, 3.9327);
    return clamp(c * t + vec3(0.0002, 0.0017, -0.0195), 0.0, 1.0);
}

void main() {
    vec2 pixel = gl_FragCoord.xy - corner.xy;
    vec2 point = vec2(pixel.x, size.y - pixel.y) / size.xy;
    int mode = int(options.x);
    if (mode == 2) {
        color = vec4(heat(radiance(left, point), radiance(right, point)), 1.0);
    } else if (mode == 1 && pixel.x >= corner.z) {
        bool line = pixel.x < corner.z + 2.0;
        color = vec4(line ? vec3(1.0) : tone_mapped(radiance(right, point)), 1.0);
    } else {
        color = vec4(tone_mapped(radiance(left, point)), 1.0);
    }
}
