//! Does every field arrive? Packs records, uploads them through the real path, reads each field back through the very
//! accessors that the tracer uses, and demands the same bits.

use crate::device::cl::{self, Arguments, Buffer};
use crate::device::gl::{Headless, Program, TableTexture, Target};
use crate::error::{Error, Result};
use crate::program::source::{Options, Source, assemble};
use crate::records::{Declaration, Field, MAX_EXACT_INDEX, RECORDS, Record, TEXEL, Texel};

/// How a field was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// OpenGL, `texelFetch`.
    GlFetch,
    /// OpenGL, a GL_NEAREST sample at the texel's centre.
    GlSample,
    /// OpenGL, uniforms.
    GlUniform,
    /// OpenCL, each lane its own record.
    ClEach,
    /// OpenCL, one record for all lanes.
    ClSame,
}

/// One line of the table: a record, a count, a way.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Check {
    /// The record's name.
    pub record: &'static str,
    /// How it was read.
    pub path: Path,
    /// Records in the table.
    pub count: usize,
    /// Texture width, a power of two (GL only).
    pub width_log2: Option<u32>,
    /// Floats compared.
    pub values: usize,
    /// The first difference: record, field, expected and found.
    pub wrong: Option<String>,
}

/// The define of small scenes, see [`crate::records::SHAPES_IN_UNIFORMS`].
const IN_UNIFORMS: &str = "SCENE_IN_UNIFORMS";

/// Counts that wrap, fill and overflow rows, and a million for real.
pub const COUNTS: [usize; 8] = [0, 1, 16, 255, 256, 257, 65_537, 1_000_003];

/// Where fields can be read: each device is optional, but somebody must be there.
#[derive(Default)]
pub struct Readers {
    /// An OpenGL context.
    pub gl: Option<Headless>,
    /// An OpenCL device.
    pub cl: Option<cl::Context>,
}

/// Checks all records at all counts, widths and ways; `inject` breaks the accessor of one field (`object.color`).
/// Each finished line goes to `done`.
///
/// # Errors
/// [`Error::Driver`] without any device; [`Error::Device`] and [`Error::Build`] from the devices. A wrong value is not
/// an error here: see [`Check::wrong`].
pub fn validate(readers: &Readers, inject: Option<&str>, mut done: impl FnMut(&Check)) -> Result<Vec<Check>> {
    if readers.gl.is_none() && readers.cl.is_none() {
        return Err(Error::Driver("neither OpenGL nor OpenCL is there to validate".into()));
    }
    let mut checks = Vec::new();
    let mut add = |check: Check| {
        done(&check);
        checks.push(check);
    };
    for record in RECORDS {
        let counts: &[usize] = if record.single { &[1] } else { &COUNTS };
        for &count in counts {
            let floats = pattern(count * record.texels * TEXEL, record.table.len() as u32);
            check_one(readers, record, &floats, 0, inject, &mut add)?;
        }
    }
    // The last records below 2²⁴, the largest index that a float holds exactly.
    let last = MAX_EXACT_INDEX as usize;
    let narrow = RECORDS.iter().find(|r| r.name == Texel::NAME).expect("texels are declared");
    let floats = pattern(last * narrow.texels * TEXEL, 7);
    check_one(readers, narrow, &floats, last - 256, inject, &mut add)?;
    Ok(checks)
}

/// All ways for one table, from record `first` on.
fn check_one(
    readers: &Readers,
    record: &Declaration,
    floats: &[u32],
    first: usize,
    inject: Option<&str>,
    add: &mut impl FnMut(Check),
) -> Result<()> {
    let stride = record.texels * TEXEL;
    let count = floats.len() / stride;
    let options = Options { inject: inject.map(String::from), table: record.table, ..Options::default() };
    if let Some(headless) = &readers.gl {
        // Narrow rows for small tables, wide ones for all: a texture's height is limited too.
        let widths: &[u32] = if record.single {
            &[11]
        } else if count <= 65_537 {
            &[6, 11, 12]
        } else {
            &[11, 12]
        };
        for &width_log2 in widths.iter().take(if first > 0 { 1 } else { widths.len() }) {
            for path in [Path::GlFetch, Path::GlSample, Path::GlUniform] {
                let define = match path {
                    Path::GlUniform if record.single => "SINGLE",
                    Path::GlUniform if count <= record.in_uniforms && width_log2 == widths[0] => IN_UNIFORMS,
                    Path::GlFetch if !record.single => "FETCHED",
                    Path::GlSample if !record.single => "SAMPLED",
                    _ => continue,
                };
                let defines = vec![define.to_string()];
                let options = Options { texture_width_log2: width_log2, defines, ..options.clone() };
                let source = assemble("validate.frag", None, &options);
                let found = read_gl(headless, record, &source, width_log2, floats, first)?;
                add(compare(record, path, Some(width_log2), floats, first, &found));
            }
        }
    }
    if let Some(context) = &readers.cl {
        let defines = vec![format!("VALIDATED {}", record.table)];
        let options = Options { lanes: context.device.lanes, defines, ..options };
        let source = assemble("validate.cl", None, &options);
        for (path, kernel) in [(Path::ClEach, "validate_each"), (Path::ClSame, "validate_same")] {
            let found = read_cl(context, record, &source, kernel, floats, first)?;
            add(compare(record, path, None, floats, first, &found));
        }
    }
    Ok(())
}

/// For each field, the bits read back: `fields × (count − first) × 3` words.
type Found = Vec<Vec<[u32; 3]>>;

fn read_gl(
    headless: &Headless,
    record: &Declaration,
    source: &Source,
    width_log2: u32,
    floats: &[u32],
    first: usize,
) -> Result<Found> {
    let count = floats.len() / (record.texels * TEXEL) - first;
    if count == 0 {
        // Nothing to read, but an empty table must go up without complaint.
        TableTexture::new(&headless.gl, width_log2)?.fill_texels(floats)?;
        return Ok(vec![Vec::new(); record.fields.len()]);
    }
    let columns = count.min(1024);
    let target = Target::new(&headless.gl, columns as u32, count.div_ceil(columns) as u32, true)?;
    let mut table = TableTexture::new(&headless.gl, width_log2)?;
    let program = Program::new(&headless.gl, source)?;
    let uniforms = record.single || source.permutation.contains(IN_UNIFORMS);
    program.activate();
    if uniforms {
        program.set_texels(record.table, bytemuck::cast_slice(floats));
    } else {
        table.fill_texels(floats)?;
        table.bind(&program, record.table);
    }
    program.set_int("first", first as i32);
    program.set_int("stride", columns as i32);
    let mut found = Vec::new();
    for field in 0..record.fields.len() {
        program.set_int("field", field as i32);
        target.draw(&program)?;
        let bits: Vec<[u32; 3]> = target.read().iter().take(count).map(|[x, y, z, _]| [*x, *y, *z]).collect();
        found.push(bits);
    }
    Ok(found)
}

fn read_cl(
    context: &cl::Context,
    record: &Declaration,
    source: &Source,
    kernel: &str,
    floats: &[u32],
    first: usize,
) -> Result<Found> {
    let count = floats.len() / (record.texels * TEXEL) - first;
    let table = Buffer::from_slice(context, floats)?;
    let bits = Buffer::<[u32; 3]>::new(context, count)?;
    let lanes = if kernel == "validate_each" { context.device.lanes as usize } else { 1 };
    let items = count.div_ceil(lanes);
    let kernel = context.kernel(source, kernel)?;
    let mut found = Vec::new();
    for field in 0..record.fields.len() as i32 {
        let args = Arguments::new().with(record.table, &table).with("bits", &bits).with("field", field);
        let args = args.with("first", first as i32).with("count", count as i32);
        context.launch(&kernel, &args, &[items], Some(&[64]))?;
        found.push(bits.to_vec(context)?);
    }
    Ok(found)
}

/// Bits against bits, for every field of every record.
fn compare(
    record: &Declaration,
    path: Path,
    width_log2: Option<u32>,
    floats: &[u32],
    first: usize,
    found: &Found,
) -> Check {
    let stride = record.texels * TEXEL;
    let count = floats.len() / stride;
    let mut check = Check { record: record.name, path, count, width_log2, values: 0, wrong: None };
    for (Field { name, offset, floats: width }, found) in record.fields.iter().zip(found) {
        for (number, bits) in (first..count).zip(found) {
            let expected = &floats[number * stride + offset..][..*width];
            check.values += width;
            if expected != &bits[..*width] && check.wrong.is_none() {
                let show = |bits: &[u32]| {
                    let values: Vec<String> =
                        bits.iter().map(|b| format!("{:e} ({b:#010x})", f32::from_bits(*b))).collect();
                    values.join(", ")
                };
                check.wrong = Some(format!(
                    "{} {number}, field {name}: expected {}, found {}",
                    record.name,
                    show(expected),
                    show(&bits[..*width])
                ));
            }
        }
    }
    check
}

/// Finite floats of every kind, as bits: the special ones first, then a hash of the place.
fn pattern(floats: usize, salt: u32) -> Vec<u32> {
    let special = [
        0.0f32,
        -0.0,
        f32::MIN_POSITIVE,
        -f32::MIN_POSITIVE,
        f32::from_bits(1),            // the smallest denormal
        -f32::from_bits(0x007f_ffff), // the largest
        f32::MAX,
        f32::MIN,
        1.0,
        (MAX_EXACT_INDEX - 1) as f32,
        MAX_EXACT_INDEX as f32,
    ];
    (0..floats as u32)
        .map(|i| match i % 17 {
            k @ 0..11 => special[(k + i / 17) as usize % special.len()].to_bits(),
            _ => {
                let bits = crate::rays::random::hash2_u(i, salt);
                // All exponent bits set would be NaN or infinity, which drivers may rewrite.
                if bits & 0x7f80_0000 == 0x7f80_0000 { bits & !0x0080_0000 } else { bits }
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_pattern_has_every_special_value_and_nothing_else_than_numbers() {
        let bits = pattern(10_000, 3);
        assert!(bits.iter().all(|b| f32::from_bits(*b).is_finite()));
        for wanted in [(-0.0f32).to_bits(), 1, 0x807f_ffff, f32::MAX.to_bits(), f32::MIN.to_bits()] {
            assert!(bits.contains(&wanted), "{wanted:#x}");
        }
    }

    #[test]
    fn one_wrong_bit_is_named() {
        let record = RECORDS.iter().find(|r| r.name == "light").unwrap();
        let floats = pattern(5 * record.texels * TEXEL, 0);
        let read = |floats: &[u32]| -> Found {
            let place = |f: &Field| floats.chunks(6).map(|r| [r[f.offset], r[f.offset + 1], r[f.offset + 2]]).collect();
            record.fields.iter().map(place).collect()
        };
        let sound = compare(record, Path::GlFetch, None, &floats, 0, &read(&floats));
        assert_eq!((sound.values, sound.wrong), (30, None));
        let mut broken = floats.clone();
        broken[6 * 3 + 4] ^= 1;
        let wrong = compare(record, Path::GlFetch, None, &floats, 0, &read(&broken)).wrong.unwrap();
        assert!(wrong.starts_with("light 3, field intensity: expected"), "{wrong}");
    }
}
