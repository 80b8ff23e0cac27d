//! Typed access to a spanned TOML tree: whatever is asked for and not there becomes an error with its place.

use std::borrow::Cow;
use std::ops::{Range, RangeInclusive};

use glam::DVec3;
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::error::{Position, SceneError, near};
use crate::settings::Choice;

/// Result of reading one thing from a scene file.
pub type Read<T> = Result<T, Box<SceneError>>;

/// The text being read, and the name under which errors speak of it.
pub struct Text<'a> {
    /// All of it.
    pub text: &'a str,
    /// As the user named it.
    pub file: &'a str,
}

impl Text<'_> {
    /// An error at the byte `offset`.
    pub fn error(&self, offset: usize, found: impl Into<String>, expected: impl Into<String>) -> Box<SceneError> {
        Box::new(SceneError {
            file: self.file.to_owned(),
            position: Some(Position::of(self.text, offset)),
            found: found.into(),
            expected: expected.into(),
            did_you_mean: None,
        })
    }

    /// The bytes of `span` on one line, as written, cut where it gets long.
    pub fn quote(&self, span: Range<usize>) -> String {
        const LONGEST: usize = 60; // characters: with file name and expectation still a line or two
        let quoted = self.text.get(span).unwrap_or_default();
        let mut line = String::new();
        for (count, word) in quoted.split_whitespace().enumerate() {
            if count > 0 {
                line.push(' ');
            }
            // Control characters would garble a terminal.
            line.extend(word.chars().take(LONGEST + 1).map(|c| if c.is_control() { '\u{fffd}' } else { c }));
            if line.chars().count() > LONGEST {
                return line.chars().take(LONGEST - 1).chain(['…']).collect();
            }
        }
        line
    }
}

/// The numbers that a key accepts. NaN and the infinities never hold.
pub struct Rule {
    /// Whether a finite number is accepted.
    pub holds: fn(f64) -> bool,
    /// The same in words, after "expected".
    pub expected: &'static str,
}

/// A table of the file, and how its messages call it: `[camera]`, `[[spheres]]`.
pub struct Table<'a> {
    /// What it is a part of.
    pub text: &'a Text<'a>,
    /// `[camera]`, `[[spheres]]`.
    pub title: Cow<'a, str>,
    /// Byte where its header (or its brace) stands.
    pub at: usize,
    /// By key.
    pub entries: &'a DeTable<'a>,
}

impl<'a> Table<'a> {
    /// Refuses the first key of the table that is not among `known`.
    pub fn allow_only(&self, known: &[&'static str]) -> Read<()> {
        let first = self
            .entries
            .keys()
            .filter(|key| !known.contains(&key.get_ref().as_ref()))
            .min_by_key(|key| key.span().start);
        let Some(key) = first else { return Ok(()) };
        let mut error = self.text.error(
            key.span().start,
            format!("unknown key `{}` in {}", self.text.quote(key.span()), self.title),
            format!("one of {}", known.join(", ")),
        );
        error.did_you_mean = near(key.get_ref(), known.iter().copied());
        Err(error)
    }

    /// The value of `key`, if it is there.
    pub fn get(&self, key: &'static str) -> Option<Field<'a>> {
        Some(self.entry(key, self.entries.get(key)?))
    }

    /// One of the table's values, under the name that messages shall use.
    pub fn entry(&self, key: &'static str, value: &'a Spanned<DeValue<'a>>) -> Field<'a> {
        Field { text: self.text, key, index: None, value }
    }

    /// The value of `key`, which has no default; `expected` shows how it is written.
    pub fn need(&self, key: &'static str, expected: &str) -> Read<Field<'a>> {
        self.get(key).ok_or_else(|| self.text.error(self.at, format!("{} without {key}", self.title), expected))
    }

    /// The number `key`, or `default` without it.
    pub fn number_or(&self, key: &'static str, rule: &Rule, default: f64) -> Read<f64> {
        self.get(key).map_or(Ok(default), |field| field.number(rule))
    }

    /// Reads every table of the array of tables `key`, each called `title`; an absent one is empty.
    pub fn list<T>(
        &self,
        key: &'static str,
        title: &'static str,
        mut read: impl FnMut(&Table<'a>) -> Read<T>,
    ) -> Read<Vec<T>> {
        match self.get(key) {
            Some(field) => field.tables(title)?.map(|table| read(&table?)).collect(),
            None => Ok(Vec::new()),
        }
    }
}

/// A value of the file, and the name that its messages use: `radius`, `center[1]`.
#[derive(Clone, Copy)]
pub struct Field<'a> {
    text: &'a Text<'a>,
    key: &'static str,
    /// Which element of an array it is. Kept apart from the key, because an allocation for each of the numbers of
    /// 100,000 spheres would show.
    index: Option<usize>,
    value: &'a Spanned<DeValue<'a>>,
}

impl<'a> Field<'a> {
    /// Byte where the value starts.
    pub fn at(&self) -> usize {
        self.value.span().start
    }

    /// The value as the file has it: `radius = -1.0`, `center[1] = nan`.
    pub fn quote(&self) -> String {
        let name = match self.index {
            Some(index) => format!("{}[{index}]", self.key),
            None => self.key.to_owned(),
        };
        match self.value.get_ref() {
            DeValue::Table(_) => format!("{name} as a table"),
            DeValue::Array(array) if matches!(array.first().map(Spanned::get_ref), Some(DeValue::Table(_))) => {
                format!("{name} as an array of tables")
            }
            _ => format!("{name} = {}", self.text.quote(self.value.span())),
        }
    }

    /// An error about the value as it stands.
    pub fn wrong(&self, expected: impl Into<String>) -> Box<SceneError> {
        self.text.error(self.at(), self.quote(), expected)
    }

    /// An error about the value's type.
    fn wrong_type(&self, expected: &str) -> Box<SceneError> {
        let mut error = self.wrong(expected);
        error.found += match self.value.get_ref() {
            DeValue::String(_) => " (a string)",
            DeValue::Integer(_) => " (an integer)",
            DeValue::Float(_) => " (a number with a fraction)",
            DeValue::Boolean(_) => " (a boolean)",
            DeValue::Datetime(_) => " (a date or time)",
            DeValue::Array(_) | DeValue::Table(_) => "",
        };
        error
    }

    /// A number that obeys `rule`; integers are numbers too.
    pub fn number(&self, rule: &Rule) -> Read<f64> {
        let number = match self.value.get_ref() {
            DeValue::Float(float) => float.as_str().parse().unwrap_or(f64::NAN),
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str().parse().unwrap_or(f64::NAN),
            DeValue::Integer(integer) => {
                i128::from_str_radix(integer.as_str(), integer.radix()).map_or(f64::NAN, |i| i as f64)
            }
            _ => return Err(self.wrong_type(rule.expected)),
        };
        if number.is_finite() && (rule.holds)(number) { Ok(number) } else { Err(self.wrong(rule.expected)) }
    }

    /// A whole number in `range`.
    pub fn integer(&self, range: RangeInclusive<u64>, expected: &str) -> Read<u64> {
        let DeValue::Integer(integer) = self.value.get_ref() else {
            return Err(self.wrong_type(expected));
        };
        i64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .and_then(|integer| u64::try_from(integer).ok())
            .filter(|integer| range.contains(integer))
            .ok_or_else(|| self.wrong(expected))
    }

    /// The value if it is a string, else an error that says what was expected.
    pub fn string(&self, expected: &str) -> Read<&'a str> {
        match self.value.get_ref() {
            DeValue::String(string) => Ok(string),
            _ => Err(self.wrong_type(expected)),
        }
    }

    /// One of a few words.
    pub fn word(&self, words: &[&'static str]) -> Read<&'static str> {
        let expected = format!("one of \"{}\"", words.join("\", \""));
        let found = self.string(&expected)?;
        words.iter().find(|word| **word == found).copied().ok_or_else(|| {
            let mut error = self.wrong(expected);
            error.did_you_mean = near(found, words.iter().copied());
            error
        })
    }

    /// One of the ways that users can name.
    pub fn choice<T: Choice>(&self) -> Read<T> {
        let names: Vec<_> = T::offered().map(|row| row.name).collect();
        Ok(T::named(self.word(&names)?).expect("one of its own names"))
    }

    /// An array of exactly `N` values; `expected` shows how it is written.
    pub fn array<const N: usize>(&self, expected: &str) -> Read<[Field<'a>; N]> {
        let DeValue::Array(array) = self.value.get_ref() else {
            return Err(self.wrong_type(expected));
        };
        if array.len() != N {
            let mut error = self.wrong(expected);
            let plural = if array.len() == 1 { "" } else { "s" };
            error.found += &format!(" ({} value{plural})", array.len());
            return Err(error);
        }
        Ok(std::array::from_fn(|index| self.element(index, &array[index])))
    }

    /// Three numbers that each obey `rule`.
    pub fn vector(&self, expected: &str, rule: &Rule) -> Read<DVec3> {
        let [x, y, z] = self.array(expected)?;
        Ok(DVec3::new(x.number(rule)?, y.number(rule)?, z.number(rule)?))
    }

    /// A table, called `title` from here on.
    pub fn table(&self, title: impl Into<Cow<'a, str>>) -> Read<Table<'a>> {
        let title = title.into();
        match self.value.get_ref() {
            DeValue::Table(entries) => Ok(Table { text: self.text, title, at: self.at(), entries }),
            _ => Err(self.wrong_type(&format!("a table {title}"))),
        }
    }

    /// The tables of an array of tables, each called `title`.
    pub fn tables(&self, title: &'static str) -> Read<impl ExactSizeIterator<Item = Read<Table<'a>>>> {
        let DeValue::Array(array) = self.value.get_ref() else {
            return Err(self.wrong_type(&format!("an array of tables, each written {title}")));
        };
        let field = *self;
        Ok(array.iter().enumerate().map(move |(index, value)| match value.get_ref() {
            DeValue::Table(entries) => {
                Ok(Table { text: field.text, title: title.into(), at: value.span().start, entries })
            }
            _ => Err(field.element(index, value).wrong_type(&format!("a table {title}"))),
        }))
    }

    fn element(&self, index: usize, value: &'a Spanned<DeValue<'a>>) -> Field<'a> {
        Field { index: Some(index), value, ..*self }
    }
}
