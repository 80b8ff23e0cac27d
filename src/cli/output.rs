//! Where everything is printed: stdout for results, stderr for what goes on.
//!
//! A stream may be closed while the program works (`| head -1`, a terminal that is gone) or have no room left. Neither is
//! a reason to stop working, let alone to lose a picture: what cannot be printed is dropped. At the end a closed stream
//! changes nothing, since whoever closed it wants no more; a full one is an error, told on the other stream.

use std::fmt;
use std::io::{self, ErrorKind, IsTerminal as _, Write};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{LazyLock, Mutex, MutexGuard, PoisonError};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

use crate::error::Result;

/// What became of a stream.
enum Fate {
    Open,
    /// Nobody reads it any more.
    Closed,
    /// It took no more, and why.
    Failed(io::Error),
}

/// One of the two streams.
struct Stream {
    fate: Mutex<Fate>,
    /// It was a terminal when the program began: what it answers once it is closed is EIO, which of a file is an error.
    terminal: bool,
}

impl Stream {
    fn fate(&self) -> MutexGuard<'_, Fate> {
        self.fate.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what was never refused so far.
    fn write(&self, mut to: impl Write, text: &str) {
        let mut fate = self.fate();
        if matches!(*fate, Fate::Open) {
            if let Err(error) = to.write_all(text.as_bytes()).and_then(|()| to.flush()) {
                *fate = self.fate_of(error);
            }
        }
    }

    fn fate_of(&self, error: io::Error) -> Fate {
        match error.kind() {
            ErrorKind::BrokenPipe | ErrorKind::ConnectionReset => Fate::Closed,
            _ if self.terminal => Fate::Closed,
            _ => Fate::Failed(error),
        }
    }

    /// Why it took no more, where that is an error.
    fn failure(&self) -> Option<String> {
        match &*self.fate() {
            Fate::Failed(error) => Some(error.to_string()),
            Fate::Open | Fate::Closed => None,
        }
    }
}

static STDOUT: LazyLock<Stream> =
    LazyLock::new(|| Stream { fate: Mutex::new(Fate::Open), terminal: io::stdout().is_terminal() });
static STDERR: LazyLock<Stream> =
    LazyLock::new(|| Stream { fate: Mutex::new(Fate::Open), terminal: io::stderr().is_terminal() });

/// Stdout holds a JSON object, to which nothing may be added.
static HOLDS_JSON: AtomicBool = AtomicBool::new(false);

/// Notes what the streams are, before a terminal can go away.
pub fn begin() {
    LazyLock::force(&STDOUT);
    LazyLock::force(&STDERR);
}

/// Prints on stdout.
pub fn print(text: impl fmt::Display) {
    STDOUT.write(io::stdout().lock(), &text.to_string());
}

/// Prints a formatted line on stdout, as `println!` does, which panics where the line cannot be written.
macro_rules! say {
    ($($line:tt)*) => { $crate::cli::output::print_line(format_args!($($line)*)) };
}

/// Prints a line on stdout.
pub fn print_line(line: impl fmt::Display) {
    print(format_args!("{line}\n"));
}

/// Prints one JSON object on stdout.
pub fn print_json(value: &impl serde::Serialize) {
    HOLDS_JSON.store(true, Ordering::Relaxed);
    print_line(serde_json::to_string_pretty(value).expect("records of numbers and strings always serialise"));
}

/// A line for the user on stderr.
pub fn notice(line: &str) {
    STDERR.write(io::stderr().lock(), &format!("photile: {line}\n"));
}

/// Tells which files a suite has left.
pub fn say_written(paths: Vec<std::path::PathBuf>) {
    paths.iter().for_each(|path| notice(&format!("wrote {}", path.display())));
}

/// Prints help, a version or what is wrong with the command line, in colours where there is a terminal. The exit code.
pub fn print_usage(usage: &clap::Error) -> u8 {
    if let Err(error) = usage.print() {
        let stream: &Stream = if usage.use_stderr() { &STDERR } else { &STDOUT };
        *stream.fate() = stream.fate_of(error);
    }
    usage.exit_code() as u8
}

/// Tells an error, and which stream had no room. The program's exit code: the work's own, or 1 where a stream was full.
pub fn end(result: Result<()>) -> ExitCode {
    let code = match result {
        Ok(()) => 0,
        Err(error) => {
            notice(&error.to_string());
            error.exit_code()
        }
    };
    ExitCode::from(end_with(code))
}

/// As [`end`], for an exit code that is known.
pub fn end_with(code: u8) -> u8 {
    let (stdout, stderr) = (STDOUT.failure(), STDERR.failure());
    if let Some(why) = &stdout {
        notice(&format!("stdout: cannot write: {why}"));
    }
    if let (Some(why), false) = (&stderr, HOLDS_JSON.load(Ordering::Relaxed)) {
        print_line(format_args!("photile: stderr: cannot write: {why}"));
    }
    if stdout.is_some() || stderr.is_some() { code.max(1) } else { code }
}

/// Columns that a line on stdout may have: the terminal's, or those that most have room for.
pub fn columns() -> usize {
    let terminal = console::Term::stdout();
    let size = if STDOUT.terminal { terminal.size_checked() } else { None };
    size.map_or(120, |(_, columns)| usize::from(columns).max(40))
}

/// A bar of progress on stderr, hidden where that is no terminal. Templates know `{left}`, the time that is left, `?`
/// before that can be told.
pub fn bar(length: Option<u64>, template: &str) -> ProgressBar {
    let target = if STDERR.terminal { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(length, target);
    set_template(&bar, template);
    bar
}

/// Gives a bar another template.
pub fn set_template(bar: &ProgressBar, template: &str) {
    let left = |state: &ProgressState, to: &mut dyn fmt::Write| {
        // Nothing done or no end in sight: indicatif would say 0 s.
        let known = state.pos() > 0 && state.len().is_some_and(|length| length > 0);
        // What cannot be drawn is dropped, as with every bar.
        let _ = match known {
            true => write!(to, "{:#}", indicatif::HumanDuration(state.eta())),
            false => write!(to, "?"),
        };
    };
    if let Ok(style) = ProgressStyle::with_template(template) {
        bar.set_style(style.with_key("left", left));
    }
}

/// Does all of several things, whichever fail: the first error.
pub fn all(results: impl IntoIterator<Item = Result<()>>) -> Result<()> {
    let mut first = Ok(());
    for result in results {
        match (&first, result) {
            (Ok(()), Err(error)) => first = Err(error),
            (Err(_), Err(error)) => notice(&error.to_string()),
            (_, Ok(())) => {}
        }
    }
    first
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Error;

    struct Answers(io::Result<()>);

    impl Write for Answers {
        fn write(&mut self, buffer: &[u8]) -> io::Result<usize> {
            match &self.0 {
                Ok(()) => Ok(buffer.len()),
                Err(error) => Err(error.kind().into()),
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    #[test]
    fn closed_streams_are_no_error_and_full_ones_are() {
        let after = |error: io::Error, terminal| {
            let stream = Stream { fate: Mutex::new(Fate::Open), terminal };
            stream.write(Answers(Err(error)), "a line");
            stream.write(Answers(Ok(())), "another");
            stream.failure()
        };
        assert_eq!(after(ErrorKind::BrokenPipe.into(), false), None);
        assert!(after(ErrorKind::StorageFull.into(), false).is_some());
        assert_eq!(after(io::Error::from_raw_os_error(5), true), None, "a terminal that is gone answers EIO");
        assert!(after(io::Error::from_raw_os_error(5), false).is_some(), "a file's EIO is an error");
    }

    #[test]
    fn all_is_done_whatever_fails_first() {
        let failed = |what: &str| Err(Error::Failed(what.into()));
        assert!(all([Ok(()), Ok(())]).is_ok());
        assert_eq!(all([Ok(()), failed("a"), failed("b")]).unwrap_err().to_string(), "a");
    }
}
