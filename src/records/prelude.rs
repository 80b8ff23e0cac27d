//! The accessors that shaders and kernels read records by, as text.

use std::fmt::Write;

use super::record::TEXEL;
use super::tables::{Declaration, LISTS, RECORDS};

/// The accessors as `#define`s: `object_color(i)` where lanes may ask for different records, and
/// `object_color_same(i)` where all ask for the same; `object_color_scalar(i)` is that one value, not yet spread over
/// the lanes; `frame_width()` for single records, whose triples have a `_scalar` form too.
///
/// `inject` shifts that field (`object.color`) by one channel or texel, so that a test can see the checks fail.
pub fn prelude(inject: Option<&str>) -> String {
    let mut text = String::new();
    for record in RECORDS {
        let Declaration { name, table, texels, .. } = record;
        // Scene tables have macros of their own: they may be uniforms.
        let (declaration, fetch) = match (record.single, record.in_uniforms) {
            (true, _) => (format!("PARAMS({table}, {texels})"), "PARAM"),
            (false, 0) => (format!("TABLE({table})"), "FETCH"),
            (false, most) => (format!("SCENE_TABLE({table}, {})", most * texels), "SCENE"),
        };
        writeln!(text, "{declaration}").expect("writing to a string");
        for field in record.fields {
            let shift = if inject == Some(&format!("{name}.{}", field.name)) { field.floats } else { 0 };
            let offset = (field.offset + shift) % (record.texels * TEXEL);
            let (texel, channel) = (offset / TEXEL, offset % TEXEL);
            let field_name = field.name;
            let line = match (record.single, field.floats) {
                (true, 1) => format!("#define {name}_{field_name}() PARAM1({table}, {texel}, {channel})"),
                (true, _) => format!(
                    "#define {name}_{field_name}() PARAM3({table}, {texel})\n\
                     #define {name}_{field_name}_scalar() PARAM3_SCALAR({table}, {texel})"
                ),
                (false, 1) => format!(
                    "#define {name}_{field_name}(i) {fetch}1({table}, i, {texels}, {texel}, {channel})\n\
                     #define {name}_{field_name}_same(i) {fetch}1_SAME({table}, i, {texels}, {texel}, {channel})\n\
                     #define {name}_{field_name}_scalar(i) {fetch}1_SCALAR({table}, i, {texels}, {texel}, {channel})"
                ),
                (false, _) => format!(
                    "#define {name}_{field_name}(i) {fetch}3({table}, i, {texels}, {texel})\n\
                     #define {name}_{field_name}_same(i) {fetch}3_SAME({table}, i, {texels}, {texel})\n\
                     #define {name}_{field_name}_scalar(i) {fetch}3_SCALAR({table}, i, {texels}, {texel})"
                ),
            };
            writeln!(text, "{line}").expect("writing to a string");
        }
    }
    for (list, accessor) in LISTS {
        writeln!(text, "LIST({list})\n#define {accessor}(i) ENTRY({list}, i)").expect("writing to a string");
    }
    text
}

/// Reads of every field of a table's records by its accessor, `FIELD3(0, object_anchor(i))`, for `validate`'s programs, which
/// define `FIELD1` and `FIELD3`. `same` takes the accessors that load one record for all lanes.
///
/// # Panics
/// When no table has this name.
pub fn field_reads(table: &str, same: bool) -> String {
    let record = RECORDS.iter().find(|r| r.table == table).unwrap_or_else(|| panic!("no table named {table}"));
    let argument = if record.single { "()" } else { "(i)" };
    let suffix = if same && !record.single { "_same" } else { "" };
    let mut text = String::new();
    for (number, field) in record.fields.iter().enumerate() {
        writeln!(text, "FIELD{}({number}, {}_{}{suffix}{argument})", field.floats, record.name, field.name)
            .expect("writing to a string");
    }
    text
}

/// Whether `name` is a field as `--inject` names it, `record.field`.
pub fn is_field(name: &str) -> bool {
    RECORDS.iter().any(|r| r.fields.iter().any(|f| format!("{}.{}", r.name, f.name) == name))
}
