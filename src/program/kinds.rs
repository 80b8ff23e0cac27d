//! Dispatch among kinds of shape in shaders and kernels: blocks that stand once for each kind, and where each kind's
//! shapes lie in the table. Kinds that a scene lacks are left out by `#ifdef HAS_SPHERES` and the like.

use std::fmt::Write;

use crate::kinds::{KindName, SHAPE_KINDS};

/// A block of the dialect for one kind: `kind`, `KINDS` and `KIND` are its name.
pub fn expand(line: &str, kind: &KindName) -> String {
    line.replace("KINDS", &kind.plural.to_uppercase())
        .replace("KIND", &kind.singular.to_uppercase())
        .replace("kind", kind.singular)
}

/// The kinds' ranges of the shape table, as `#define`s: `SPHERE_COUNT`, `FIRST_SPHERE`, `END_SPHERE`; `IS_SPHERE(shape)`
/// with no more comparisons than the kinds that a program has ask for; `SPHERE_COMES_FIRST` for the first of these.
pub fn ranges() -> String {
    let mut text = String::new();
    let (mut end, mut end_of_cuts) = ("0".to_string(), "0".to_string());
    for (number, kind) in SHAPE_KINDS.iter().enumerate() {
        let name = kind.singular.to_uppercase();
        let has = |others: &[KindName]| {
            let each: Vec<String> =
                others.iter().map(|k| format!("defined(HAS_{})", k.plural.to_uppercase())).collect();
            if each.is_empty() { "0".to_string() } else { each.join(" || ") }
        };
        let (before, after) = (has(&SHAPE_KINDS[..number]), has(&SHAPE_KINDS[number + 1..]));
        let is_last = "((shape) >= FIRST_{name})";
        // Known to the compiler where shapes are few (features.rs): it unrolls what loops over them.
        write!(
            text,
            "#ifndef HAS_{plural}\n#define {name}_COUNT 0\n#elif !defined({name}_COUNT)\n#define {name}_COUNT count_of(frame_{singular}_count())\n#endif\n\
             #define FIRST_{name} {end}\n#define END_{name} (FIRST_{name} + {name}_COUNT)\n\
             #if !({before})\n#ifdef HAS_{plural}\n#define {name}_COMES_FIRST\n#endif\n\
             #define IS_{name}(shape) ((shape) < END_{name})\n\
             #elif !({after})\n#define IS_{name}(shape) {is_last}\n\
             #else\n#define IS_{name}(shape) ((shape) >= FIRST_{name} && (shape) < END_{name})\n#endif\n",
            singular = kind.singular,
            plural = kind.plural.to_uppercase(),
            is_last = is_last.replace("{name}", &name),
        )
        .expect("writing to a string");
        write!(
            text,
            "#define FIRST_CUT_OF_{name} {end_of_cuts}\n\
             #define END_CUT_OF_{name} (FIRST_CUT_OF_{name} + {name}_CUTS * {name}_COUNT)\n\
             #ifndef HAS_{plural}\n#define {name}_CUTS 0\n#endif\n",
            plural = kind.plural.to_uppercase(),
        )
        .expect("writing to a string");
        (end, end_of_cuts) = (format!("END_{name}"), format!("END_CUT_OF_{name}"));
    }
    writeln!(text, "#define SHAPE_COUNT {end}\n#define CUT_COUNT {end_of_cuts}").expect("writing to a string");
    text
}

/// Includes of the kinds' own files, each only where a scene has the kind.
pub fn includes() -> Vec<String> {
    let file = |kind: &KindName| {
        [
            format!("#ifdef HAS_{}", kind.plural.to_uppercase()),
            format!("#include \"shared/shapes/{}.glsl\"", kind.singular),
            "#endif".to_string(),
        ]
    };
    SHAPE_KINDS.iter().flat_map(file).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_takes_the_kinds_name() {
        assert_eq!(
            expand("for (int i = FIRST_KIND; i < END_KIND; i++) kind_hit(i); // HAS_KINDS", &SHAPE_KINDS[1]),
            "for (int i = FIRST_PLANE; i < END_PLANE; i++) plane_hit(i); // HAS_PLANES"
        );
    }
}
