//! Random numbers are the same integers on every backend, so samples lie in the very same places.

use photile::device::cl::{self, Arguments, Buffer};
use photile::device::gl::{Headless, Program, Target};
use photile::program::source::{Options, assemble_text};
use photile::rays::camera::{jitter_x, jitter_y};
use photile::rays::random::{hash_u, hash2_u, owen_scramble, sobol_second, unit_real};

use crate::common::{missing, one_at_a_time};

/// How many indices; all work-items, lanes and both halves of the words see some.
const COUNT: u32 = 16_384;
/// Spreads small indices over all 32 bits.
const SPREAD: u32 = 2_654_435_761;

/// What the twins draw for an index: eight numbers.
fn twins(i: u32) -> [u32; 8] {
    let key = hash2_u(i >> 4, i.wrapping_mul(SPREAD));
    [
        hash_u(i),
        key,
        i.wrapping_mul(SPREAD).reverse_bits(),
        owen_scramble(i.wrapping_mul(SPREAD), key),
        sobol_second(i.wrapping_mul(SPREAD)),
        unit_real(key).to_bits(),
        jitter_x(i & 63, key).to_bits(),
        jitter_y(i & 63, key).to_bits(),
    ]
}

/// The same in the shared dialect, for an index `i`; `PUT(number, value)` takes them.
const NUMBERS: &str = "    Uint spread = i * 2654435761u;\n    Uint key = hash2_u(i >> 4u, spread);\n\
    PUT(0, hash_u(i))\n    PUT(1, key)\n    PUT(2, reverse_bits(spread))\n    PUT(3, owen_scramble(spread, key))\n\
    PUT(4, sobol_second(spread))\n    PUT(5, bits_of(unit_real(key)))\n\
    PUT(6, bits_of(jitter_x(i & 63u, key)))\n    PUT(7, bits_of(jitter_y(i & 63u, key)))\n";

const INCLUDES: &str = "#include \"layout\"\n#include \"shared/vector.glsl\"\n#include \"shared/random.glsl\"\n\
    #include \"shared/camera.glsl\"\n";

fn kernel() -> String {
    format!(
        "#include \"shim.cl\"\n{INCLUDES}\
         #if LANES == 1\n#define PUT(number, value) numbers[base * 8 + number] = value;\n#else\n\
         #define PUT(number, value) CONCAT(vstore, LANES)(value, 0, each); \\\n\
         for (int lane = 0; lane < LANES; lane++) numbers[(base + lane) * 8 + number] = each[lane];\n#endif\n\
         __kernel void draw(__global uint *numbers) {{\n    int base = (int)get_global_id(0) * LANES;\n\
         uint each[LANES];\n    Uint i = to_uint(lanes_i(base) + LANE_ROW * LANE_COLUMNS + LANE_COLUMN);\n{NUMBERS}}}\n"
    )
}

fn fragment() -> String {
    format!(
        "#include \"shim.glsl\"\n{INCLUDES}uniform int first;\nout uvec4 numbers;\n\
         #define PUT(number, value) if (number >= first && number < first + 4) numbers[number - first] = value;\n\
         void main() {{\n    uint i = uint(gl_FragCoord.x) + 128u * uint(gl_FragCoord.y);\n    numbers = uvec4(0u);\n\
         {NUMBERS}}}\n"
    )
}

/// Indices whose numbers are not the twins'.
fn wrong(found: impl Fn(usize) -> [u32; 8]) -> usize {
    (0..COUNT).filter(|i| found(*i as usize) != twins(*i)).count()
}

#[test]
fn opencl_draws_the_twins_numbers() {
    one_at_a_time();
    let device = cl::devices(None).and_then(|mut devices| cl::Context::new(devices.remove(0)));
    let Ok(context) = device.map_err(|error| missing("OpenCL", &error)) else { return };
    for lanes in [1, context.device.lanes] {
        let source = assemble_text("draw.cl", &kernel(), &Options { lanes, ..Options::default() });
        let kernel = context.kernel(&source, "draw").unwrap_or_else(|error| panic!("{error}"));
        let numbers = Buffer::<[u32; 8]>::new(&context, COUNT as usize).unwrap();
        context
            .launch(&kernel, &Arguments::new().with("numbers", &numbers), &[(COUNT / lanes) as usize], None)
            .unwrap();
        let numbers = numbers.to_vec(&context).unwrap();
        assert_eq!(wrong(|i| numbers[i]), 0, "{lanes} lanes");
        assert!(wrong(|i| numbers[i ^ 1]) > 0);
    }
}

#[test]
fn opengl_draws_the_twins_numbers() {
    one_at_a_time();
    let Ok(context) = Headless::new().map_err(|error| missing("OpenGL", &error)) else { return };
    let source = assemble_text("draw.frag", &fragment(), &Options::default());
    let program = Program::new(&context.gl, &source).unwrap_or_else(|error| panic!("{error}"));
    let target = Target::new(&context.gl, 128, COUNT / 128, true).unwrap();
    let halves = [0, 4].map(|first| {
        program.activate();
        program.set_int("first", first);
        target.draw(&program).unwrap();
        target.read()
    });
    let found = |i: usize| std::array::from_fn(|n| halves[n / 4][i][n % 4]);
    assert_eq!(wrong(found), 0);
}
