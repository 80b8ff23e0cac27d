//! Arguments of kernels by the names of their parameters.

use std::cell::RefCell;
use std::rc::Rc;

use bytemuck::Pod;
use opencl3::types::cl_mem;

use super::Buffer;
use crate::error::{Error, Result};
use crate::program::parameters::{Kind, Parameter};
use crate::records::Record;

/// A value for a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Arg {
    /// A buffer of any type.
    Memory(cl_mem),
    /// `int`
    Int(i32),
    /// `uint`
    Uint(u32),
    /// `float`
    Float(f32),
    /// `__local` memory, bytes.
    Local(usize),
}

impl<T: Pod> From<&Buffer<T>> for Arg {
    fn from(buffer: &Buffer<T>) -> Self {
        Arg::Memory(buffer.handle())
    }
}

impl From<i32> for Arg {
    fn from(value: i32) -> Self {
        Arg::Int(value)
    }
}

impl From<u32> for Arg {
    fn from(value: u32) -> Self {
        Arg::Uint(value)
    }
}

impl From<f32> for Arg {
    fn from(value: f32) -> Self {
        Arg::Float(value)
    }
}

impl Arg {
    fn kind(&self) -> Kind {
        match self {
            Arg::Memory(_) => Kind::Memory,
            Arg::Int(_) => Kind::Int,
            Arg::Uint(_) => Kind::Uint,
            Arg::Float(_) => Kind::Float,
            Arg::Local(_) => Kind::Local,
        }
    }
}

/// What a launch gives a kernel: a value for each of its parameters, by name and in any order.
#[derive(Clone, Debug, Default)]
pub struct Arguments {
    given: Vec<(&'static str, Arg)>,
}

impl Arguments {
    /// None yet.
    pub fn new() -> Arguments {
        Arguments::default()
    }

    /// With a table of records, under the name that their declaration has for it.
    pub fn table<R: Record>(self, table: &Buffer<R>) -> Arguments {
        self.with(R::TABLE, table)
    }

    /// With a value for the parameter of this name.
    pub fn with(mut self, name: &'static str, value: impl Into<Arg>) -> Arguments {
        self.given.push((name, value.into()));
        self
    }

    /// With another's too.
    pub fn and(mut self, others: &Arguments) -> Arguments {
        self.given.extend_from_slice(&others.given);
        self
    }

    /// With another table of records in the place of the one that was given.
    pub fn replace<R: Record>(mut self, table: &Buffer<R>) -> Arguments {
        self.given.retain(|(name, _)| *name != R::TABLE);
        self.table(table)
    }
}

/// Where a kernel's arguments go: its parameters, and how those of the last launch, which has the names of the next one
/// nearly always, fell into their order.
pub(super) struct Places {
    kernel: String,
    parameters: Rc<[Parameter]>,
    last: RefCell<Option<Order>>,
}

struct Order {
    /// Names and types of what was given.
    given: Vec<(&'static str, Kind)>,
    /// For each parameter, which of these it takes.
    places: Vec<usize>,
}

impl Places {
    pub(super) fn new(kernel: &str, parameters: Rc<[Parameter]>) -> Places {
        Places { kernel: kernel.into(), parameters, last: RefCell::new(None) }
    }

    /// Hands out a value for each parameter, in their order. Whether the order is another than the last one's.
    ///
    /// # Errors
    /// [`Error::Device`] with the name of what is missing, given twice, unknown to the kernel or of another type.
    pub(super) fn in_order(&self, args: &Arguments, mut set: impl FnMut(Arg)) -> Result<bool> {
        let mut last = self.last.borrow_mut();
        let names_of = |given: &[(&'static str, Kind)]| {
            let mut both = given.iter().zip(&args.given);
            given.len() == args.given.len() && both.all(|(known, (name, arg))| *known == (*name, arg.kind()))
        };
        let is_known = last.as_ref().is_some_and(|order| names_of(&order.given));
        let order = match last.take().filter(|_| is_known) {
            Some(order) => order,
            None => Order {
                given: args.given.iter().map(|(name, arg)| (*name, arg.kind())).collect(),
                places: self.resolve(args)?,
            },
        };
        for place in &order.places {
            set(args.given[*place].1);
        }
        *last = Some(order);
        Ok(!is_known)
    }

    /// For each parameter, which of the arguments it takes.
    fn resolve(&self, args: &Arguments) -> Result<Vec<usize>> {
        let refused = |name: &str, what: &str| {
            let takes: Vec<&str> = self.parameters.iter().map(|parameter| &*parameter.name).collect();
            Err(Error::Device(format!("kernel {}: '{name}' {what}; it takes {}", self.kernel, takes.join(", "))))
        };
        for (number, (name, _)) in args.given.iter().enumerate() {
            if args.given[..number].iter().any(|(other, _)| other == name) {
                return refused(name, "is given twice");
            }
            if !self.parameters.iter().any(|parameter| parameter.name == *name) {
                return refused(name, "is given, but no parameter");
            }
        }
        let mut places = Vec::with_capacity(self.parameters.len());
        for Parameter { name, kind } in self.parameters.iter() {
            match args.given.iter().position(|(given, _)| given == name) {
                None => return refused(name, "is not given"),
                Some(place) if args.given[place].1.kind() != *kind => {
                    return refused(name, &format!("is {kind:?}, given was {:?}", args.given[place].1.kind()));
                }
                Some(place) => places.push(place),
            }
        }
        Ok(places)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places() -> Places {
        let parameter = |name: &str, kind| Parameter { name: name.into(), kind };
        let parameters = [
            parameter("objects", Kind::Memory),
            parameter("width", Kind::Int),
            parameter("weight", Kind::Float),
            parameter("queue", Kind::Local),
        ];
        Places::new("trace", parameters.into())
    }

    fn objects() -> Arg {
        Arg::Memory(std::ptr::null_mut())
    }

    fn given(places: &Places, args: &Arguments) -> Result<Vec<Arg>> {
        let mut found = Vec::new();
        places.in_order(args, |arg| found.push(arg)).map(|_| found)
    }

    #[test]
    fn any_order_gives_the_kernels_own() {
        let places = places();
        let expected = [objects(), Arg::Int(3), Arg::Float(0.5), Arg::Local(64)];
        let forth = Arguments::new().with("objects", objects()).with("width", 3);
        let forth = forth.and(&Arguments::new().with("weight", 0.5).with("queue", Arg::Local(64)));
        let back = Arguments { given: forth.given.iter().rev().copied().collect() };
        for args in [&forth, &back, &back, &forth] {
            assert_eq!(given(&places, args).unwrap(), expected);
        }
        // What is known is an order, not values.
        let other = Arguments { given: forth.given.iter().map(|(name, arg)| (*name, *arg)).collect() };
        let other = Arguments { given: other.given.into_iter().filter(|(name, _)| *name != "width").collect() };
        assert_eq!(given(&places, &other.with("width", 4)).unwrap()[1], Arg::Int(4));
    }

    #[test]
    fn what_does_not_fit_is_refused_by_name() {
        let places = places();
        let most = Arguments::new().with("objects", objects()).with("weight", 0.5).with("queue", Arg::Local(64));
        for (args, words) in [
            (most.clone(), "kernel trace: 'width' is not given; it takes objects, width, weight, queue"),
            (most.clone().with("weight", 0.5), "'weight' is given twice"),
            (most.clone().with("wdith", 3), "'wdith' is given, but no parameter"),
            (most.clone().with("width", 3u32), "'width' is Int, given was Uint"),
        ] {
            let error = given(&places, &args).unwrap_err().to_string();
            assert!(error.contains(words), "{error}");
            assert!(given(&places, &most.clone().with("width", 3)).is_ok(), "a refusal leaves nothing behind");
        }
        // After a launch that was right, too.
        assert!(given(&places, &most).is_err());
    }
}
