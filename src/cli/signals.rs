//! Signals that end the program: SIGINT (Ctrl-C), SIGTERM (`timeout`, `docker stop`, batch systems), SIGHUP (a closed
//! terminal), SIGXCPU (a limit of time). The first one lets work that holds something end after the part at hand and
//! save it; where nothing is held, and at the second one, the program ends at once, but never in the middle of a file.
//!
//! What was ignored when the program began stays ignored: `nohup` means it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use super::output::notice;
use crate::film::finish_writing;

/// Work that holds something.
struct Held {
    /// What is finished before it ends, `pass`.
    part: &'static str,
    /// Set by the first signal.
    stop: Arc<AtomicBool>,
}

static HELD: Mutex<Option<Held>> = Mutex::new(None);

/// A flag that the first signal sets, for work that stops after the `part` at hand; the second one ends the program.
pub fn stop_on_signal(part: &'static str) -> Arc<AtomicBool> {
    let stop = Arc::new(AtomicBool::new(false));
    *HELD.lock().unwrap_or_else(PoisonError::into_inner) = Some(Held { part, stop: stop.clone() });
    stop
}

/// Whether a signal was the first one for work that holds something; else the program shall end.
fn is_heeded(name: &str) -> bool {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
    match &*held {
        Some(Held { part, stop }) if !stop.swap(true, Ordering::Relaxed) => {
            notice(&format!("{name}: stopping after this {part}; Ctrl-C again ends at once"));
            true
        }
        _ => false,
    }
}

/// Begins to listen. To be called once, before threads that compute are made.
#[cfg(unix)]
pub fn listen() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXCPU, SIGXFSZ};
    use signal_hook::iterator::Signals;
    use signal_hook::low_level;

    let ignored = ignored();
    let heeded = [SIGINT, SIGTERM, SIGHUP, SIGXCPU].into_iter().filter(|signal| ignored >> (signal - 1) & 1 == 0);
    // Beyond a limit of file size, writing shall fail as on a full disk: nobody asks whether this flag was set.
    let _ = signal_hook::flag::register(SIGXFSZ, Arc::default());
    let mut signals = match Signals::new(heeded) {
        Ok(signals) => signals,
        Err(error) => return notice(&format!("Ctrl-C will not save what is done: {error}")),
    };
    let listening = std::thread::Builder::new().spawn(move || {
        for signal in signals.forever() {
            let name = low_level::signal_name(signal).unwrap_or("a signal");
            let first = !HELD.lock().unwrap_or_else(PoisonError::into_inner).as_ref().is_some_and(|held| {
                held.stop.load(Ordering::Relaxed) // then this one is the second
            });
            if is_heeded(name) {
                continue;
            }
            finish_writing();
            if first {
                // As if nobody had listened: shells and batch systems see what ended it.
                let _ = low_level::emulate_default_handler(signal);
            }
            low_level::exit(128 + signal); // as a shell reports it
        }
    });
    if let Err(error) = listening {
        notice(&format!("Ctrl-C will not save what is done: {error}"));
    }
}

/// As above.
#[cfg(not(unix))]
pub fn listen() {
    let listening = ctrlc::set_handler(|| {
        if !is_heeded("Ctrl-C") {
            finish_writing();
            std::process::exit(130);
        }
    });
    if let Err(error) = listening {
        notice(&format!("Ctrl-C will not save what is done: {error}"));
    }
}

/// Signals that were ignored when the program began, signal n in bit n − 1; none where the system does not tell.
#[cfg(unix)]
fn ignored() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0)
}
