//! Rows of named values: one table serves the terminal, CSV and JSON.

use serde::ser::{Serialize, SerializeMap, Serializer};

/// What stands in a table.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A name, or a word for one of a few things.
    Text(String),
    /// A number of things.
    Count(u64),
    /// A measured quantity; its column's name has the unit.
    Real(f64),
    /// Whether something holds.
    Flag(bool),
    /// Not measured, or without meaning here.
    Missing,
}

impl From<&str> for Value {
    fn from(text: &str) -> Self {
        Value::Text(text.into())
    }
}

impl From<u32> for Value {
    fn from(count: u32) -> Self {
        Value::Count(count.into())
    }
}

impl From<u64> for Value {
    fn from(count: u64) -> Self {
        Value::Count(count)
    }
}

impl From<f32> for Value {
    fn from(real: f32) -> Self {
        // By way of its decimal digits: 0.1f32 is meant as 0.1, not as 0.10000000149.
        Value::Real(real.to_string().parse().unwrap_or(f64::from(real)))
    }
}

impl From<f64> for Value {
    fn from(real: f64) -> Self {
        Value::Real(real)
    }
}

impl From<bool> for Value {
    fn from(flag: bool) -> Self {
        Value::Flag(flag)
    }
}

/// A field of a row that was read from a file.
impl From<&serde_json::Value> for Value {
    fn from(json: &serde_json::Value) -> Self {
        match json {
            serde_json::Value::String(text) => Value::Text(text.clone()),
            serde_json::Value::Bool(flag) => Value::Flag(*flag),
            serde_json::Value::Number(number) => match number.as_u64() {
                Some(count) => Value::Count(count),
                None => number.as_f64().into(),
            },
            _ => Value::Missing,
        }
    }
}

impl<T: Into<Value>> From<Option<T>> for Value {
    fn from(value: Option<T>) -> Self {
        value.map_or(Value::Missing, T::into)
    }
}

impl Value {
    /// The number in it; `None` where there is none.
    pub fn number(&self) -> Option<f64> {
        match self {
            Value::Count(count) => Some(*count as f64),
            Value::Real(real) => Some(*real),
            _ => None,
        }
    }

    /// For people: four digits that matter.
    fn shown(&self) -> String {
        match self {
            Value::Text(text) => text.clone(),
            Value::Count(count) => count.to_string(),
            Value::Real(real) => shown(*real),
            Value::Flag(flag) => if *flag { "yes" } else { "" }.into(),
            Value::Missing => "-".into(),
        }
    }

    /// For programs: all digits, quotes where CSV needs them (RFC 4180).
    fn csv(&self) -> String {
        match self {
            Value::Text(text) if text.contains(['"', ',', '\n', '\r']) => format!("\"{}\"", text.replace('"', "\"\"")),
            Value::Text(text) => text.clone(),
            Value::Count(count) => count.to_string(),
            Value::Real(real) if real.is_finite() => real.to_string(),
            Value::Real(_) | Value::Missing => String::new(),
            Value::Flag(flag) => flag.to_string(),
        }
    }
}

/// A number in four digits.
pub fn shown(real: f64) -> String {
    let size = real.abs();
    match size {
        _ if !real.is_finite() => "-".into(),
        0.0 => "0".into(),
        _ if !(1e-3..1e6).contains(&size) => format!("{real:.3e}"),
        _ => format!("{real:.*}", (3 - size.log10().floor() as i32).max(0) as usize),
    }
}

impl Serialize for Value {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Value::Text(text) => serializer.serialize_str(text),
            Value::Count(count) => serializer.serialize_u64(*count),
            Value::Real(real) => serializer.serialize_f64(*real), // JSON writes null for NaN and infinity
            Value::Flag(flag) => serializer.serialize_bool(*flag),
            Value::Missing => serializer.serialize_none(),
        }
    }
}

/// Named columns and rows of values. JSON: an array with an object a row.
#[derive(Clone, Debug, PartialEq, Default)]
pub struct Table {
    /// Names, with units where there are any.
    pub columns: Vec<String>,
    rows: Vec<Vec<Value>>,
}

impl Table {
    /// A table of these columns that has no row yet.
    pub fn new<S: Into<String>>(columns: impl IntoIterator<Item = S>) -> Table {
        Table { columns: columns.into_iter().map(S::into).collect(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// When it has not a value for each column.
    pub fn push(&mut self, row: impl IntoIterator<Item = Value>) {
        let row: Vec<Value> = row.into_iter().collect();
        assert_eq!(row.len(), self.columns.len(), "a value for each of {:?}", self.columns);
        self.rows.push(row);
    }

    /// How many rows it has.
    pub fn len(&self) -> usize {
        self.rows.len()
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The rows, each with its values in the order of the columns.
    pub fn rows(&self) -> &[Vec<Value>] {
        &self.rows
    }

    /// The value of a row in the column of that name.
    ///
    /// # Panics
    /// When there is no such row or column.
    pub fn at(&self, row: usize, column: &str) -> &Value {
        let place = self.columns.iter().position(|name| name == column);
        &self.rows[row][place.unwrap_or_else(|| panic!("no column {column} among {:?}", self.columns))]
    }

    /// For a terminal: aligned, numbers to the right, ends with a newline.
    pub fn text(&self) -> String {
        self.text_within(usize::MAX)
    }

    /// As [`Table::text`], in lines of so many columns at most: where a row has more, its texts go on below, at words. What
    /// cannot be narrower than a terminal is as narrow as it can be.
    pub fn text_within(&self, columns: usize) -> String {
        let cells: Vec<Vec<String>> = self.rows.iter().map(|row| row.iter().map(Value::shown).collect()).collect();
        let all = || std::iter::once(&self.columns).chain(&cells);
        let is_text = |column: usize| self.rows.iter().any(|row| matches!(row[column], Value::Text(_)));
        let mut widths: Vec<usize> = (0..self.columns.len())
            .map(|column| all().map(|row| row[column].chars().count()).max().unwrap_or(0))
            .collect();
        // Narrowest that a column may be: numbers stay whole, texts are wrapped at their words.
        let least: Vec<usize> = (0..self.columns.len())
            .map(|column| {
                let words = all().flat_map(|row| row[column].split(' ')).map(|word| word.chars().count());
                if is_text(column) { words.max().unwrap_or(0) } else { widths[column] }
            })
            .collect();
        let gaps = 2 * self.columns.len().saturating_sub(1);
        while widths.iter().sum::<usize>().saturating_add(gaps) > columns {
            let shrinkable = (0..widths.len()).filter(|column| widths[*column] > least[*column]);
            match shrinkable.max_by_key(|column| widths[*column]) {
                Some(widest) => widths[widest] -= 1,
                None => break,
            }
        }
        let line = |cells: &[String]| {
            let wrapped: Vec<Vec<String>> =
                cells.iter().zip(&widths).map(|(cell, width)| wrapped(cell, *width)).collect();
            let height = wrapped.iter().map(Vec::len).max().unwrap_or(0);
            let lines = (0..height).map(|i| {
                let padded = wrapped.iter().enumerate().map(|(column, lines)| {
                    let (cell, width) = (lines.get(i).map_or("", String::as_str), widths[column]);
                    if is_text(column) { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
                });
                padded.collect::<Vec<_>>().join("  ").trim_end().to_string() + "\n"
            });
            lines.collect::<String>()
        };
        all().map(|row| line(row)).collect()
    }

    /// For spreadsheets and plots: RFC 4180 with a line of names, empty where nothing was measured.
    pub fn csv(&self) -> String {
        let line = |cells: Vec<String>| cells.join(",") + "\n";
        let names = line(self.columns.iter().map(|name| Value::from(name.as_str()).csv()).collect());
        names + &self.rows.iter().map(|row| line(row.iter().map(Value::csv).collect())).collect::<String>()
    }
}

/// A text in lines of so many characters, broken at spaces; a longer word has a line of its own.
pub(super) fn wrapped(text: &str, width: usize) -> Vec<String> {
    if text.chars().count() <= width {
        return vec![text.to_string()];
    }
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut().filter(|line| line.chars().count() + 1 + word.chars().count() <= width) {
            Some(line) => *line = format!("{line} {word}"),
            None => lines.push(word.to_string()),
        }
    }
    lines
}

/// A row under its columns' names, which keep their order.
struct Row<'a>(&'a [String], &'a [Value]);

impl Serialize for Row<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in self.0.iter().zip(self.1) {
            map.serialize_entry(name, value)?;
        }
        map.end()
    }
}

impl Serialize for Table {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.rows.iter().map(|row| Row(&self.columns, row)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new(["scene", "ms", "auto"]);
        table.push(["a,\"b\"".into(), 12.34567.into(), true.into()]);
        table.push(["c".into(), Value::Missing, false.into()]);
        table
    }

    #[test]
    fn the_same_rows_as_text_csv_and_json() {
        let table = table();
        assert_eq!(table.text(), "scene     ms  auto\na,\"b\"  12.35   yes\nc          -\n");
        assert_eq!(table.csv(), "scene,ms,auto\n\"a,\"\"b\"\"\",12.34567,true\nc,,false\n");
        let json = serde_json::to_string(&table).unwrap();
        assert_eq!(json, r#"[{"scene":"a,\"b\"","ms":12.34567,"auto":true},{"scene":"c","ms":null,"auto":false}]"#);
        assert_eq!(table.at(0, "ms").number(), Some(12.34567));
    }

    #[test]
    fn wide_rows_go_on_below_at_words() {
        let mut table = Table::new(["case", "n"]);
        table.push(["a ray that grazes a sphere".into(), 12_345u64.into()]);
        assert_eq!(table.text_within(80), table.text());
        assert_eq!(table.text_within(20), "case               n\na ray that     12345\ngrazes a\nsphere\n");
        assert!(table.text_within(1).lines().all(|line| line.len() <= 13), "as narrow as words and numbers let it");
    }

    #[test]
    #[should_panic(expected = "a value for each")]
    fn a_short_row_is_refused() {
        table().push([Value::Missing]);
    }

    #[test]
    fn numbers_keep_four_digits() {
        let cases = [(1234.5, "1234"), (0.0123456, "0.01235"), (9.9999, "10.000"), (2.5e7, "2.500e7"), (0.0, "0")];
        for (real, expected) in cases {
            assert_eq!(shown(real), expected);
        }
        assert_eq!(shown(f64::NAN), "-");
        assert_eq!(Value::from(0.1f32), Value::Real(0.1));
    }
}
