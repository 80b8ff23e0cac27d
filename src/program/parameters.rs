//! The parameters of kernels, as an assembled text declares them. Launches give arguments by these names
//! (`device::cl::Arguments`), so that the kernel's own text is the one place with an order.
//!
//! The text is gone through as the driver's preprocessor does it, as far as our sources take: conditions of `defined`, `!`,
//! `&&`, `||` and comparisons, and macros without parameters. `Context::kernel` holds their number against
//! the driver's.

use std::collections::{BTreeMap, HashMap};

/// What a parameter takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A pointer to the device's memory.
    Memory,
    /// A pointer to memory of a work-group.
    Local,
    /// `int`
    Int,
    /// `uint`
    Uint,
    /// `float`
    Float,
}

/// One parameter of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Parameter {
    /// Its name in the kernel.
    pub name: String,
    /// What it takes.
    pub kind: Kind,
}

/// Kernels by name, with their parameters in order.
pub type Kernels = BTreeMap<String, Vec<Parameter>>;

/// All kernels that a text has under its own `#define`s.
///
/// # Errors
/// What cannot be understood, in words.
pub fn kernels(text: &str) -> Result<Kernels, String> {
    let joined = text.replace("\\\n", " ");
    let mut preprocessor = Preprocessor::default();
    let mut found = Kernels::new();
    let mut head = String::new();
    for line in joined.lines() {
        let line = line.split("//").next().unwrap_or_default().trim();
        if let Some(directive) = line.strip_prefix('#') {
            preprocessor.directive(directive.trim_start())?;
            continue;
        }
        if !preprocessor.is_active() || (head.is_empty() && !line.contains("__kernel")) {
            continue;
        }
        head.push_str(line);
        head.push(' ');
        if line.contains('{') {
            let (name, parameters) = declaration(&preprocessor.expand(&head, 0)?)?;
            found.insert(name, parameters);
            head.clear();
        }
    }
    Ok(found)
}

/// Name and parameters of `__kernel … void name(type a, type b) {`.
fn declaration(head: &str) -> Result<(String, Vec<Parameter>), String> {
    let strange = || format!("not a kernel's head: {head}");
    let (_, rest) = head.split_once("void").ok_or_else(strange)?;
    let (name, rest) = rest.split_once('(').ok_or_else(strange)?;
    let (list, _) = rest.split_once(')').ok_or_else(strange)?;
    let parameters = list.split(',').filter(|parameter| !parameter.trim().is_empty());
    let parameters = parameters.map(|text| parameter(text).ok_or_else(|| format!("parameter '{text}' of {name}")));
    Ok((name.trim().to_string(), parameters.collect::<Result<_, _>>()?))
}

fn parameter(text: &str) -> Option<Parameter> {
    let words: Vec<&str> = text.split(|c: char| !is_word(c)).filter(|word| !word.is_empty()).collect();
    let (name, before) = words.split_last()?;
    let kind = match *before.last()? {
        _ if before.contains(&"__global") => Kind::Memory,
        _ if before.contains(&"__local") => Kind::Local,
        "int" => Kind::Int,
        "uint" => Kind::Uint,
        "float" => Kind::Float,
        _ => return None,
    };
    Some(Parameter { name: name.to_string(), kind })
}

fn is_word(c: char) -> bool {
    c.is_ascii_alphanumeric() || c == '_'
}

/// Macros, and the conditions that the current line stands under.
#[derive(Default)]
struct Preprocessor<'a> {
    /// Bodies; none for macros with parameters, which are left as they stand.
    macros: HashMap<&'a str, Option<&'a str>>,
    /// From the outermost `#if` in.
    conditions: Vec<Condition>,
}

/// One `#if` with its `#elif`s.
struct Condition {
    /// Whether the lines between here and the next branch count.
    holds: bool,
    /// Whether any branch so far did.
    has_held: bool,
}

/// What a sign between two numbers asks.
type Comparison = fn(i64, i64) -> bool;

/// Deeper expansions are a circle.
const MAX_DEPTH: usize = 32;

impl<'a> Preprocessor<'a> {
    fn is_active(&self) -> bool {
        self.conditions.iter().all(|condition| condition.holds)
    }

    fn directive(&mut self, directive: &'a str) -> Result<(), String> {
        let (word, rest) = directive.split_at(directive.find(|c| !is_word(c)).unwrap_or(directive.len()));
        let rest = rest.trim();
        let stray = || format!("#{word} without #if");
        match word {
            "if" | "ifdef" | "ifndef" => {
                let holds = self.is_active()
                    && match word {
                        "ifdef" => self.macros.contains_key(rest),
                        "ifndef" => !self.macros.contains_key(rest),
                        _ => self.evaluate(rest)? != 0,
                    };
                self.conditions.push(Condition { holds, has_held: holds });
            }
            "elif" | "else" => {
                let Condition { has_held, .. } = self.conditions.pop().ok_or_else(stray)?;
                let holds = !has_held && self.is_active() && (word == "else" || self.evaluate(rest)? != 0);
                self.conditions.push(Condition { holds, has_held: has_held || holds });
            }
            "endif" => _ = self.conditions.pop().ok_or_else(stray)?,
            "define" if self.is_active() => {
                let (name, body) = rest.split_at(rest.find(|c| !is_word(c)).unwrap_or(rest.len()));
                self.macros.insert(name, (!body.starts_with('(')).then_some(body.trim()));
            }
            "undef" if self.is_active() => _ = self.macros.remove(rest),
            _ => {}
        }
        Ok(())
    }

    /// The text with macros replaced.
    fn expand(&self, text: &str, depth: usize) -> Result<String, String> {
        if depth > MAX_DEPTH {
            return Err(format!("macros in a circle: {text}"));
        }
        let mut expanded = String::new();
        let mut rest = text;
        while let Some(first) = rest.chars().next() {
            let end = match is_word(first) {
                true => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                false => first.len_utf8(),
            };
            let (token, after) = rest.split_at(end);
            match self.macros.get(token) {
                Some(Some(body)) => expanded.push_str(&self.expand(body, depth + 1)?),
                _ => expanded.push_str(token),
            }
            rest = after;
        }
        Ok(expanded)
    }

    /// The value of a condition; names without a macro are 0.
    fn evaluate(&self, condition: &str) -> Result<i64, String> {
        let mut rest = condition;
        let value = self.any(&mut rest)?;
        if rest.trim().is_empty() { Ok(value) } else { Err(format!("condition '{condition}'")) }
    }

    fn any(&self, rest: &mut &str) -> Result<i64, String> {
        let mut value = self.all(rest)?;
        while take(rest, "||") {
            value = i64::from((self.all(rest)? != 0) | (value != 0));
        }
        Ok(value)
    }

    fn all(&self, rest: &mut &str) -> Result<i64, String> {
        let mut value = self.comparison(rest)?;
        while take(rest, "&&") {
            value = i64::from((self.comparison(rest)? != 0) & (value != 0));
        }
        Ok(value)
    }

    fn comparison(&self, rest: &mut &str) -> Result<i64, String> {
        let value = self.single(rest)?;
        let comparisons: [(&str, Comparison); 6] = [
            ("==", |a, b| a == b),
            ("!=", |a, b| a != b),
            (">=", |a, b| a >= b),
            ("<=", |a, b| a <= b),
            (">", |a, b| a > b),
            ("<", |a, b| a < b),
        ];
        match comparisons.into_iter().find(|(sign, _)| take(rest, sign)) {
            Some((_, compare)) => Ok(i64::from(compare(value, self.single(rest)?))),
            None => Ok(value),
        }
    }

    fn single(&self, rest: &mut &str) -> Result<i64, String> {
        if take(rest, "!") {
            return Ok(i64::from(self.single(rest)? == 0));
        }
        if take(rest, "(") {
            let value = self.any(rest)?;
            return if take(rest, ")") { Ok(value) } else { Err(format!("condition: ) expected at '{rest}'")) };
        }
        let found = word(rest).ok_or_else(|| format!("condition: a name or number expected at '{rest}'"))?;
        if found == "defined" {
            let in_parentheses = take(rest, "(");
            let name = word(rest).ok_or("defined() without a name")?;
            if in_parentheses && !take(rest, ")") {
                return Err(format!("defined({name} is not closed"));
            }
            return Ok(i64::from(self.macros.contains_key(name)));
        }
        if found.starts_with(|c: char| c.is_ascii_digit()) {
            return found.trim_end_matches(['u', 'U']).parse().map_err(|_| format!("condition: number {found}"));
        }
        match self.macros.get(found) {
            Some(Some(body)) => self.evaluate(body),
            _ => Ok(0),
        }
    }
}

/// Takes a sign off the front, where it stands there.
fn take(rest: &mut &str, sign: &str) -> bool {
    let after = rest.trim_start().strip_prefix(sign);
    // `!` is no sign of its own in front of `=`.
    let after = after.filter(|after| sign != "!" || !after.starts_with('='));
    *rest = after.unwrap_or(rest);
    after.is_some()
}

/// Takes a name or number off the front.
fn word<'b>(rest: &mut &'b str) -> Option<&'b str> {
    let text = rest.trim_start();
    let (word, after) = text.split_at(text.find(|c| !is_word(c)).unwrap_or(text.len()));
    *rest = after;
    (!word.is_empty()).then_some(word)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(text: &str, kernel: &str) -> Vec<String> {
        kernels(text).unwrap()[kernel].iter().map(|parameter| parameter.name.clone()).collect()
    }

    #[test]
    fn heads_are_read_with_what_their_macros_stand_for() {
        let text = "#define GROUP 64u\n#define OUTER INNER uint n,\n#define INNER __global const float *a, \\\n\
                    __local float4 *q,\n__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1)))\n\
                    void work(OUTER __global volatile int *b, // behind\n          float weight, int last) {\n}\n\
                    void helper(int x) {\n}\n__kernel void none() {}\n";
        let found = kernels(text).unwrap();
        let kinds: Vec<_> = found["work"].iter().map(|parameter| (&*parameter.name, parameter.kind)).collect();
        let expected = [
            ("a", Kind::Memory),
            ("q", Kind::Local),
            ("n", Kind::Uint),
            ("b", Kind::Memory),
            ("weight", Kind::Float),
            ("last", Kind::Int),
        ];
        assert_eq!(kinds, expected);
        assert_eq!(found.len(), 2);
        assert!(found["none"].is_empty());
    }

    #[test]
    fn conditions_choose_as_a_compiler_does() {
        let text = |condition: &str| {
            format!(
                "#define SET\n#define TWO 2u\n#define TWICE TWO\n#if {condition}\n__kernel void k(int yes) {{\n#else\n\
                 __kernel void k(int no) {{\n#endif\n}}\n"
            )
        };
        for condition in [
            "defined(SET)",
            "defined SET && !defined(UNSET)",
            "TWICE == 2 || UNSET",
            "!(UNSET > 0) && TWO >= 2 && TWO != 3",
            "UNSET == 0 && 1 < TWO",
        ] {
            assert_eq!(names(&text(condition), "k"), ["yes"], "{condition}");
            assert_eq!(names(&text(&format!("!({condition})")), "k"), ["no"], "{condition}");
        }
        assert!(kernels(&text("TWO +")).is_err());
    }

    #[test]
    fn branches_that_do_not_count_define_nothing() {
        let text = "#ifdef UNSET\n#define A int a,\n#if 1\n#define A int b,\n#endif\n#elif 1\n#define A int c,\n#elif 1\n\
                    #define A int d,\n#else\n#define A int e,\n#endif\n__kernel void k(A int last) {\n}\n#undef A\n\
                    __kernel void second(int A) {\n}\n";
        assert_eq!(names(text, "k"), ["c", "last"]);
        assert_eq!(names(text, "second"), ["A"]);
        assert!(kernels("#define A B\n#define B A\n__kernel void k(A int x) {\n").is_err(), "a circle ends");
        assert!(kernels("__kernel void k(double x) {\n").unwrap_err().contains("double x"));
    }
}
