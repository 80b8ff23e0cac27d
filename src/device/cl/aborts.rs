//! Drivers that end the whole program: an assertion in one calls `abort`, or it crashes, and no error comes back. The program
//! then begins anew in the same process, with the same command line, and does without that driver.
//!
//! [`super::probing`] finds most of such drivers before they are used. What is left is what shows later: a truncated file
//! in a driver's cache, a linker that is missed only by kernels that are not in it.

#[cfg(unix)]
use std::ffi::{CString, c_char, c_int};
#[cfg(unix)]
use std::os::unix::ffi::OsStrExt as _;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::error::{Error, Result};

/// Names the drivers that have ended the program, for the one that begins anew.
const VARIABLE: &str = "PHOTILE_ABORTED";

/// In use, by [`Driver`].
static IN_USE: [AtomicBool; 2] = [AtomicBool::new(false), AtomicBool::new(false)];

/// A driver that may have been in use when the program was ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// OpenCL's.
    OpenCl,
    /// OpenGL's.
    OpenGl,
}

impl Driver {
    fn name(self) -> &'static str {
        match self {
            Driver::OpenCl => "OpenCL",
            Driver::OpenGl => "OpenGL",
        }
    }

    /// Why this driver is not used, where it has ended the program before.
    pub fn fault(self) -> Option<String> {
        let ended = std::env::var(VARIABLE).ok()?;
        ended.split(',').any(|name| name == self.name()).then(|| {
            let name = self.name();
            format!("{name}'s driver was in use when the program crashed (its words, if any, stand above); begun anew without it")
        })
    }

    /// It is in use from now on.
    ///
    /// # Errors
    /// [`Error::Driver`] where it has ended the program before.
    pub fn begin(self) -> Result<()> {
        IN_USE[self as usize].store(true, Ordering::Relaxed);
        self.fault().map_or(Ok(()), |fault| Err(Error::Driver(fault)))
    }
}

/// What `execve` needs to begin anew, made while memory may be asked for.
#[cfg(unix)]
struct Anew {
    program: CString,
    /// With a null at the end, as all that follow.
    arguments: Vec<*const c_char>,
    /// By the driver that is to be done without; none for one that is not used anyway.
    environments: [Option<Vec<*const c_char>>; 2],
    /// What was done with each of [`SIGNALS`] before.
    before: [libc::sigaction; SIGNALS.len()],
}

/// How a driver ends a program: by assertions, by accesses to memory that is not there, by files that are shorter than they
/// say.
#[cfg(unix)]
const SIGNALS: [c_int; 5] = [libc::SIGABRT, libc::SIGSEGV, libc::SIGBUS, libc::SIGILL, libc::SIGFPE];

#[cfg(unix)]
static ANEW: std::sync::atomic::AtomicPtr<Anew> = std::sync::atomic::AtomicPtr::new(std::ptr::null_mut());

/// From now on the program begins anew where a driver ends it: once without OpenCL, once without OpenGL. Not to be called
/// by anything but the program itself, since it is the command line that is begun anew.
#[cfg(unix)]
pub fn outlive() {
    let ended = std::env::var(VARIABLE).unwrap_or_default();
    let Ok(program) = std::env::current_exe().map_err(drop).and_then(|path| text(path.as_os_str().as_bytes())) else {
        return;
    };
    let arguments = list(std::env::args_os().filter_map(|argument| text(argument.as_bytes()).ok()));
    let environments = [Driver::OpenCl, Driver::OpenGl].map(|driver| {
        let others = std::env::vars_os().filter(|(name, _)| name != VARIABLE);
        let others = others.map(|(name, value)| [name.as_bytes(), b"=", value.as_bytes()].concat());
        let own = format!("{VARIABLE}={ended},{}", driver.name()).into_bytes();
        driver.fault().is_none().then(|| list(others.chain([own]).filter_map(|variable| text(&variable).ok())))
    });
    // SAFETY: all zeros is a signal's action, the default one, with no flags and an empty mask.
    let nothing: libc::sigaction = unsafe { std::mem::zeroed() };
    // A leak on purpose: it is needed until the end.
    let anew = Box::leak(Box::new(Anew { program, arguments, environments, before: [nothing; SIGNALS.len()] }));
    for (signal, before) in SIGNALS.into_iter().zip(&mut anew.before) {
        // SAFETY: both point to actions, and the handler keeps to what a handler may do.
        unsafe { libc::sigaction(signal, &action(), before) };
    }
    ANEW.store(anew, Ordering::Release);
}

#[cfg(unix)]
fn action() -> libc::sigaction {
    // SAFETY: all zeros is an action: the default one, with no flags and an empty mask.
    let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
    action.sa_sigaction = begin_anew as extern "C" fn(c_int) as libc::sighandler_t;
    // Not blocked while it is handled: what is blocked stays so in the program that begins anew.
    action.sa_flags = libc::SA_NODEFER | libc::SA_ONSTACK;
    action
}

/// Says so again, after calls in which a driver's compiler may have taken the signals for itself: LLVM does when it first
/// writes a file, and then returns to what ends the program.
#[cfg(unix)]
pub(super) fn outlive_still() {
    if !ANEW.load(Ordering::Relaxed).is_null() {
        for signal in SIGNALS {
            // SAFETY: as above.
            unsafe { libc::sigaction(signal, &action(), std::ptr::null_mut()) };
        }
    }
}

/// As above.
#[cfg(not(unix))]
pub(super) fn outlive_still() {}

/// The handler of [`SIGNALS`]: reads memory that nobody writes, and makes calls that POSIX lists as async-signal-safe.
#[cfg(unix)]
extern "C" fn begin_anew(signal: c_int) {
    // SAFETY: null, or what was leaked above.
    let Some(anew) = (unsafe { ANEW.load(Ordering::Acquire).as_ref() }) else { return };
    // OpenCL first: it compiles more, and in OpenGL's company it only makes photons.
    let blamed = (0..2).filter(|driver| IN_USE[*driver].load(Ordering::Relaxed));
    if let Some(environment) = blamed.filter_map(|driver| anew.environments[driver].as_ref()).next() {
        // SAFETY: lists of strings that live for ever, each with a null at its end. Where the call fails it returns.
        unsafe { libc::execve(anew.program.as_ptr(), anew.arguments.as_ptr(), environment.as_ptr()) };
    }
    // No driver to blame: as if nobody had listened. What raised the signal raises it again.
    for (known, before) in SIGNALS.into_iter().zip(&anew.before).filter(|(known, _)| *known == signal) {
        // SAFETY: an action that was in force before.
        unsafe { libc::sigaction(known, before, std::ptr::null_mut()) };
    }
}

/// As above: there are no such signals here.
#[cfg(not(unix))]
pub fn outlive() {}

#[cfg(unix)]
fn text(bytes: &[u8]) -> std::result::Result<CString, ()> {
    CString::new(bytes).map_err(drop)
}

/// Pointers to strings that are never freed, and a null.
#[cfg(unix)]
fn list(texts: impl Iterator<Item = CString>) -> Vec<*const c_char> {
    texts.map(|text| text.into_raw().cast_const()).chain([std::ptr::null()]).collect()
}
