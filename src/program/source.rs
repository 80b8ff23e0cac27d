//! Assembles a shader or kernel: the files it includes, the layout's accessors and the permutation's `#define`s, with
//! a map from every line back to its file, since Mesa takes no file name in `#line`.

use std::fmt::Write;

use crate::kinds::SHAPE_KINDS;
use crate::program::features::Features;
use crate::program::kinds;
use crate::records::{self, table_sets};

/// Every source, embedded: the program runs from anywhere.
const FILES: &[(&str, &str)] = &[
    ("shim.glsl", include_str!("../../glsl/shim.glsl")),
    ("quad.vert", include_str!("../../glsl/quad.vert")),
    ("trace.frag", include_str!("../../glsl/trace.frag")),
    ("validate.frag", include_str!("../../glsl/validate.frag")),
    ("shared/vector.glsl", include_str!("../../glsl/shared/vector.glsl")),
    ("shared/random.glsl", include_str!("../../glsl/shared/random.glsl")),
    ("shared/camera.glsl", include_str!("../../glsl/shared/camera.glsl")),
    ("shared/surface.glsl", include_str!("../../glsl/shared/surface.glsl")),
    ("shared/shapes/sphere.glsl", include_str!("../../glsl/shared/shapes/sphere.glsl")),
    ("shared/shapes/flat.glsl", include_str!("../../glsl/shared/shapes/flat.glsl")),
    ("shared/shapes/quad.glsl", include_str!("../../glsl/shared/shapes/quad.glsl")),
    ("shared/shapes/plane.glsl", include_str!("../../glsl/shared/shapes/plane.glsl")),
    ("shared/scene.glsl", include_str!("../../glsl/shared/scene.glsl")),
    ("shared/bsdf.glsl", include_str!("../../glsl/shared/bsdf.glsl")),
    ("shared/direct.glsl", include_str!("../../glsl/shared/direct.glsl")),
    ("shared/kernel.glsl", include_str!("../../glsl/shared/kernel.glsl")),
    ("shared/disc.glsl", include_str!("../../glsl/shared/disc.glsl")),
    ("shared/cell.glsl", include_str!("../../glsl/shared/cell.glsl")),
    ("shared/tile.glsl", include_str!("../../glsl/shared/tile.glsl")),
    ("shared/gather.glsl", include_str!("../../glsl/shared/gather.glsl")),
    ("shared/pixel.glsl", include_str!("../../glsl/shared/pixel.glsl")),
    ("shared/texels.glsl", include_str!("../../glsl/shared/texels.glsl")),
    ("shared/site.glsl", include_str!("../../glsl/shared/site.glsl")),
    ("shared/final.glsl", include_str!("../../glsl/shared/final.glsl")),
    ("sites.frag", include_str!("../../glsl/sites.frag")),
    ("sites.cl", include_str!("../../kernels/sites.cl")),
    ("irradiance.cl", include_str!("../../kernels/irradiance.cl")),
    ("shared/sampling.glsl", include_str!("../../glsl/shared/sampling.glsl")),
    ("shared/walk.glsl", include_str!("../../glsl/shared/walk.glsl")),
    ("mean.frag", include_str!("../../glsl/mean.frag")),
    ("present.frag", include_str!("../../glsl/present.frag")),
    ("shared/faults.glsl", include_str!("../../glsl/shared/faults.glsl")),
    ("shared/stress.glsl", include_str!("../../glsl/shared/stress.glsl")),
    ("probe.frag", include_str!("../../glsl/probe.frag")),
    ("shim.cl", include_str!("../../kernels/shim.cl")),
    ("divergent_fetch.cl", include_str!("../../kernels/divergent_fetch.cl")),
    ("rounding.cl", include_str!("../../kernels/rounding.cl")),
    ("trace.cl", include_str!("../../kernels/trace.cl")),
    ("group.cl", include_str!("../../kernels/group.cl")),
    ("probe.cl", include_str!("../../kernels/probe.cl")),
    ("group_scan.cl", include_str!("../../kernels/group_scan.cl")),
    ("scan.cl", include_str!("../../kernels/scan.cl")),
    ("paths.cl", include_str!("../../kernels/paths.cl")),
    ("photons.cl", include_str!("../../kernels/photons.cl")),
    ("sort.cl", include_str!("../../kernels/sort.cl")),
    ("grid.cl", include_str!("../../kernels/grid.cl")),
    ("tiles.cl", include_str!("../../kernels/tiles.cl")),
    ("stress.frag", include_str!("../../glsl/stress.frag")),
    ("stress.cl", include_str!("../../kernels/stress.cl")),
    ("validate.cl", include_str!("../../kernels/validate.cl")),
];

/// Names that `plan --source` accepts: all that is compiled on its own.
pub fn units() -> Vec<&'static str> {
    let whole = |name: &str| {
        !name.contains('/')
            && !name.starts_with("shim")
            && !["divergent_fetch.cl", "rounding.cl", "paths.cl", "group.cl", "group_scan.cl"].contains(&name)
    };
    FILES.iter().map(|(name, _)| *name).filter(|name| whole(name)).collect()
}

/// What a program is assembled for, besides the features.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Options {
    /// Lanes of a work-item in OpenCL: 1, 4, 8 or 16. GLSL has always 1.
    pub lanes: u32,
    /// Width of the textures that tables wrap into, as a power of two.
    pub texture_width_log2: u32,
    /// Further `NAME VALUE` defines.
    pub defines: Vec<String>,
    /// See [`records::prelude`].
    pub inject: Option<String>,
    /// The table whose fields `validate` reads.
    pub table: &'static str,
    /// Products and sums may become one operation in OpenCL, as some devices' compilers have it anyway.
    pub contracted: bool,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            lanes: 1,
            texture_width_log2: records::TEXTURE_WIDTH_LOG2,
            defines: Vec::new(),
            inject: None,
            table: "shapes",
            contracted: false,
        }
    }
}

/// A program's text, ready for a driver.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// `trace.frag`, `trace.cl` …
    pub unit: String,
    /// The defines, for messages: `HAS_SPHERES HAS_LIGHTS`.
    pub permutation: String,
    /// What the driver gets.
    pub text: String,
    /// See [`Options::contracted`].
    pub contracted: bool,
    /// For each line of `text` (from 0): file and line (from 1).
    lines: Vec<(&'static str, usize)>,
}

/// Assembles a unit for a permutation.
///
/// # Panics
/// When a unit or an included file does not exist: both are compiled in, and a test assembles them all.
pub fn assemble(unit: &str, features: Option<&Features>, options: &Options) -> Source {
    assemble_root(unit, features, options, |source| source.include(unit, options))
}

/// The same for a text that is not among the embedded ones but may include them: for tests of what those define.
pub fn assemble_text(unit: &'static str, text: &str, options: &Options) -> Source {
    assemble_root(unit, None, options, |source| source.append(unit, text, options))
}

fn assemble_root(
    unit: &str,
    features: Option<&Features>,
    options: &Options,
    append_root: impl FnOnce(&mut Source),
) -> Source {
    let glsl = !unit.ends_with(".cl");
    let mut source = Source {
        unit: unit.into(),
        permutation: String::new(),
        text: String::new(),
        contracted: options.contracted,
        lines: Vec::new(),
    };
    let mut header = String::new();
    if glsl {
        header.push_str("#version 330 core\n");
    } else {
        writeln!(header, "#define LANES {}", options.lanes).expect("writing to a string");
    }
    writeln!(header, "#define TEXTURE_WIDTH_LOG2 {}", options.texture_width_log2).expect("writing to a string");
    writeln!(header, "#define TEXTURE_WIDTH {}", 1u32 << options.texture_width_log2).expect("writing to a string");
    let mut defines = features.map(Features::defines).unwrap_or_default();
    defines.extend(options.defines.iter().cloned());
    defines.extend(options.contracted.then(|| "CONTRACTED".to_string()));
    for define in &defines {
        writeln!(header, "#define {define}").expect("writing to a string");
    }
    source.permutation = defines.join(" ");
    source.append("(defines)", &header, options);
    append_root(&mut source);
    source
}

impl Source {
    fn include(&mut self, name: &str, options: &Options) {
        let (name, text) =
            FILES.iter().find(|(file, _)| *file == name).unwrap_or_else(|| panic!("no source named {name}"));
        self.append(name, text, options);
    }

    fn append(&mut self, file: &'static str, text: &str, options: &Options) {
        let lines: Vec<&str> = text.lines().collect();
        let mut index = 0;
        while index < lines.len() {
            if lines[index] != "#each shape" {
                self.append_line(file, index + 1, lines[index], options);
                index += 1;
                continue;
            }
            let block = index + 1;
            let length = lines[block..].iter().position(|line| *line == "#end each").expect("#each has its #end each");
            for kind in &SHAPE_KINDS {
                for (offset, line) in lines[block..block + length].iter().enumerate() {
                    self.append_line(file, block + offset + 1, &kinds::expand(line, kind), options);
                }
            }
            index = block + length + 1;
        }
    }

    fn append_line(&mut self, file: &'static str, number: usize, line: &str, options: &Options) {
        match line.strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"')) {
            Some("layout") => {
                self.append("(layout)", &records::prelude(options.inject.as_deref()), options);
                self.append("(table sets)", &table_sets::macros(!self.unit.ends_with(".cl")), options);
            }
            Some("fields") => self.append("(fields)", &records::field_reads(options.table, false), options),
            Some("fields same") => self.append("(fields)", &records::field_reads(options.table, true), options),
            Some("shapes") => {
                self.append("(shapes)", &kinds::ranges(), options);
                kinds::includes().iter().for_each(|line| self.append_line("(shapes)", 0, line, options));
            }
            Some(included) => self.include(included, options),
            None => {
                self.text.push_str(line);
                self.text.push('\n');
                self.lines.push((file, number));
            }
        }
    }

    /// Rewrites a driver's log so that it names our files and lines.
    ///
    /// Understands `0:LINE(COLUMN): …` (Mesa), `0(LINE) : …` (NVIDIA), `ERROR: 0:LINE: …` (Apple, Intel, AMD) and
    /// `<anything>:LINE:COLUMN: …` (clang, as PoCL, Intel and NVIDIA print it for OpenCL).
    pub fn map_log(&self, log: &str) -> String {
        let mut mapped = String::new();
        for line in log.lines().map(str::trim_end).filter(|line| !line.is_empty()) {
            match locate(line).and_then(|(number, rest)| Some((self.lines.get(number.checked_sub(1)?)?, rest))) {
                Some((&(file, number), rest)) => writeln!(mapped, "{file}:{number}: {rest}"),
                None => writeln!(mapped, "{line}"),
            }
            .expect("writing to a string");
        }
        mapped
    }
}

/// The line number that a log line names, and the message after it.
fn locate(line: &str) -> Option<(usize, &str)> {
    let message = |rest: &str| rest.len() - rest.trim_start_matches([':', ' ', ')', '(']).len();
    // Mesa, Apple: "0:12(7): error: …", "ERROR: 0:12: …"; NVIDIA: "0(12) : error …".
    let start = line.strip_prefix("ERROR: ").or(line.strip_prefix("WARNING: ")).unwrap_or(line);
    if let Some(rest) = start.strip_prefix("0:").or(start.strip_prefix("0(")) {
        let (found, rest) = number(rest)?;
        let rest = match rest.strip_prefix('(').and_then(number) {
            Some((_column, rest)) => rest,
            None => rest,
        };
        return Some((found, &rest[message(rest)..]));
    }
    // clang: "/tmp/x.cl:12:7: error: …", "<kernel>:12:7: error: …".
    for (at, _) in line.match_indices(':') {
        if let Some((found, rest)) = number(&line[at + 1..])
            && let Some((_column, rest)) = rest.strip_prefix(':').and_then(number)
            && (rest.starts_with(':') || rest.starts_with(" <"))
        {
            return Some((found, &rest[message(rest)..]));
        }
    }
    None
}

/// A leading decimal number, and what follows it.
fn number(text: &str) -> Option<(usize, &str)> {
    let digits = text.len() - text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
    Some((text[..digits].parse().ok()?, &text[digits..]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_assembles() {
        for unit in units() {
            let source = assemble(unit, None, &Options::default());
            assert_eq!(source.text.lines().count(), source.lines.len());
        }
    }

    #[test]
    fn logs_of_every_driver_name_our_files() {
        let source = assemble("trace.frag", None, &Options::default());
        let at = source.text.lines().position(|l| l.contains("Real hit_plane(")).unwrap();
        let (file, line) = source.lines[at];
        assert_eq!(file, "shared/shapes/plane.glsl");
        let expected = format!("{file}:{line}: error: 'nope' undeclared\n");
        let number = at + 1;
        for log in [
            format!("0:{number}(7): error: 'nope' undeclared"),
            format!("ERROR: 0:{number}: error: 'nope' undeclared"),
            format!("0({number}) : error: 'nope' undeclared"),
            format!("/tmp/pocl/tempfile-a7.cl:{number}:12: error: 'nope' undeclared"),
            format!("<kernel>:{number}:12: error: 'nope' undeclared"),
        ] {
            assert_eq!(source.map_log(&log), expected, "{log}");
        }
        assert_eq!(source.map_log("linking failed"), "linking failed\n");
    }
}
