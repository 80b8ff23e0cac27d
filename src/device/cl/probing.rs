//! OpenCL devices tried in a child process first: a driver that aborts, crashes or hangs there takes the child alone, and is
//! passed over with its own last words.
//!
//! The child is this program with a hidden command. It lists the devices and runs the tiny kernel of [`super::probe`] on
//! those that are wanted, in their order, until one works. A line of its stdout is a fact:
//!
//! | line | meaning |
//! |---|---|
//! | `listed N` | the drivers answered, with N devices |
//! | `trying I` | device I is next |
//! | `works I` | it computed |
//! | `fails I WHY` | it answered with an error |
//!
//! What stands after the last line without an answer is what ended it.

use std::collections::BTreeMap;
use std::io::{BufRead as _, BufReader, Read, Write as _};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, mpsc};
use std::time::{Duration, Instant};

use super::aborts::Driver;
use super::device;
use super::{Context, Device, probe, probe_anew};
use crate::error::{Error, Result};

/// All devices, GPUs before CPUs before others, in the platforms' order; with `wanted`, only those that [`device::is_wanted`] says
/// are meant.
///
/// # Errors
/// [`Error::Driver`] when there is no OpenCL or no device, or when its driver does not live through being asked;
/// [`Error::Usage`] when none is `wanted`.
pub fn devices(wanted: Option<&str>) -> Result<Vec<Device>> {
    Driver::OpenCl.begin()?;
    may_be_listed(wanted)?;
    let all = device::list()?;
    let Some(wanted) = wanted else { return Ok(all) };
    let chosen: Vec<Device> = all.iter().filter(|one| device::is_wanted(&all, one, wanted)).cloned().collect();
    if chosen.is_empty() {
        let names = all.iter().map(|one| format!("#{} '{}'", one.number + 1, one.name)).collect::<Vec<_>>();
        return Err(Error::Usage(format!("no OpenCL device matches '{wanted}'; there are {}", names.join(", "))));
    }
    Ok(chosen)
}

/// The hidden command.
pub const COMMAND: &str = "__probe-opencl";

/// A driver that takes longer until it has listed its devices does not answer at all; some need seconds for each.
const PATIENCE_TO_LIST: Duration = Duration::from_secs(30);

/// As above, until the tiny kernel has run: some compile for many seconds when their cache is empty.
const PATIENCE: Duration = Duration::from_secs(90);

/// What the child is asked.
#[derive(clap::Args)]
pub struct Args {
    /// As the option of that name
    #[arg(long)]
    device: Option<String>,
    /// These alone, by number in the list
    #[arg(long)]
    only: Option<usize>,
    /// Those not known to end the program
    #[arg(long, value_delimiter = ',')]
    skip: Vec<usize>,
}

/// The child's part.
pub fn answer(args: &Args) {
    let mut stdout = std::io::stdout();
    // Where nobody listens, nothing needs to be known.
    let mut tell = |line: String| drop(writeln!(stdout, "{line}").and_then(|()| stdout.flush()));
    let Ok(devices) = device::list() else { return tell("listed 0".into()) };
    tell(format!("listed {}", devices.len()));
    let wanted =
        |device: &Device| args.device.as_deref().is_none_or(|wanted| device::is_wanted(&devices, device, wanted));
    for device in devices.iter().filter(|device| wanted(device)) {
        let number = device.number;
        if args.skip.contains(&number) || args.only.is_some_and(|only| only != number) {
            continue;
        }
        tell(format!("trying {number}"));
        // PoCL links with the system's linker and aborts where there is none, but not for what is in its cache: that this
        // kernel is there would say nothing of the next.
        let anew = device.platform == "Portable Computing Language" && !is_in_path("ld");
        let probe = if anew { probe_anew } else { probe };
        match Context::new_untried(device.clone()).and_then(|context| probe(&context)) {
            Ok(()) => return tell(format!("works {number}")),
            Err(error) => tell(format!("fails {number} {}", error.to_string().replace('\n', " | "))),
        }
    }
}

fn is_in_path(program: &str) -> bool {
    let path = std::env::var_os("PATH").unwrap_or_default();
    std::env::split_paths(&path).any(|directory| directory.join(program).is_file())
}

/// What is known of this machine's drivers.
#[derive(Default)]
struct Known {
    /// Why devices cannot even be listed.
    broken: Option<String>,
    /// They were listed.
    listed: bool,
    /// By number: it works, or why not.
    devices: BTreeMap<usize, std::result::Result<(), String>>,
    /// A child at work, and what it was asked.
    asked: Option<(Child, Option<String>)>,
}

static ENABLED: AtomicBool = AtomicBool::new(false);
static KNOWN: Mutex<Option<Known>> = Mutex::new(None);

fn known() -> MutexGuard<'static, Option<Known>> {
    KNOWN.lock().unwrap_or_else(PoisonError::into_inner)
}

/// From now on devices are tried in a child. Not to be called by anything but the program itself, which is what the child
/// runs.
pub fn enable() {
    ENABLED.store(true, Ordering::Relaxed);
}

/// Lets a child begin, where devices will be asked for soon: it works beside what comes before that.
pub fn begin(wanted: Option<&str>) {
    let mut known = known();
    let known = known.get_or_insert_default();
    let tried = Driver::OpenCl.fault().is_none(); // else it is not used anyway
    if tried && ENABLED.load(Ordering::Relaxed) && !known.listed && known.broken.is_none() && known.asked.is_none() {
        known.asked = child(wanted, None, &[]).map(|child| (child, wanted.map(str::to_string)));
    }
}

/// Whether devices may be listed in this process.
///
/// # Errors
/// [`Error::Driver`] where a driver ended the child that listed them.
pub(super) fn may_be_listed(wanted: Option<&str>) -> Result<()> {
    begin(wanted);
    let mut known = known();
    let known = known.get_or_insert_default();
    if let Some((child, wanted)) = known.asked.take() {
        known.hear(child, wanted.as_deref());
    }
    known.broken.as_ref().map_or(Ok(()), |why| Err(Error::Driver(why.clone())))
}

/// Whether a device may be used in this process.
///
/// # Errors
/// [`Error::Device`] where it ended the child that tried it, or failed there.
pub(super) fn may_be_used(device: &Device) -> Result<()> {
    if !ENABLED.load(Ordering::Relaxed) {
        return Ok(());
    }
    let mut known = known();
    let known = known.get_or_insert_default();
    if !known.devices.contains_key(&device.number) {
        if let Some(child) = child(None, Some(device.number), &[]) {
            known.hear(child, None);
        }
    }
    match known.devices.get(&device.number) {
        Some(Err(why)) => Err(Error::Device(format!("OpenCL on {}: {why}", device.name))),
        _ => Ok(()), // also where no child could be begun: then it is tried here
    }
}

fn child(wanted: Option<&str>, only: Option<usize>, skip: &[usize]) -> Option<Child> {
    let mut command = Command::new(std::env::current_exe().ok()?);
    command.arg(COMMAND);
    command.args(wanted.map(|wanted| format!("--device={wanted}")));
    command.args(only.map(|only| format!("--only={only}")));
    if !skip.is_empty() {
        command.arg(format!("--skip={}", skip.iter().map(usize::to_string).collect::<Vec<_>>().join(",")));
    }
    // What the terminal sends to all of its processes is not for the child.
    #[cfg(unix)]
    std::os::unix::process::CommandExt::process_group(&mut command, 0);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().ok()
}

impl Known {
    /// Waits for a child and takes in what it says; where a device ended it, another child tries the next ones.
    fn hear(&mut self, mut child: Child, wanted: Option<&str>) {
        for _ in 0..64 {
            let (facts, why) = listen(child);
            let last = self.take(&facts);
            let Some(why) = why else { return };
            match last {
                None if !self.listed => {
                    self.broken = Some(format!("OpenCL's driver {why} when its devices were listed"));
                    return;
                }
                // All was said: how it ends does not matter. Some drivers crash when they are unloaded.
                None => return,
                Some(number) => self.devices.insert(number, Err(format!("its driver {why}"))),
            };
            let skip: Vec<usize> = self.devices.keys().copied().collect();
            child = match self::child(wanted, None, &skip) {
                Some(child) => child,
                None => return,
            };
        }
    }

    /// Takes in what was said; the device that there was no answer from.
    fn take(&mut self, facts: &str) -> Option<usize> {
        let mut open = None;
        for fact in facts.lines() {
            let mut words = fact.splitn(3, ' ');
            let (Some(what), Some(Ok(number))) = (words.next(), words.next().map(str::parse::<usize>)) else {
                continue;
            };
            match what {
                "listed" => self.listed = true,
                "trying" => open = Some(number),
                "works" => open = self.devices.insert(number, Ok(())).and(None),
                "fails" => {
                    let why = words.next().unwrap_or("it fails").replace(" | ", "\n");
                    open = self.devices.insert(number, Err(why)).and(None);
                }
                _ => {}
            }
        }
        open
    }
}

/// All that a child says, and where it did not end well, how it ended, in words.
fn listen(mut child: Child) -> (String, Option<String>) {
    let (sender, said) = mpsc::channel();
    let streams: [Option<Box<dyn Read + Send>>; 2] =
        [child.stdout.take().map(|s| Box::new(s) as _), child.stderr.take().map(|s| Box::new(s) as _)];
    let mut open = 0;
    for (place, stream) in streams.into_iter().enumerate() {
        let (sender, Some(stream)) = (sender.clone(), stream) else { continue };
        let read = move || {
            for line in BufReader::new(stream).split(b'\n').map_while(std::result::Result::ok) {
                // The listener may have lost patience.
                let _ = sender.send((place, Some(String::from_utf8_lossy(&line).into_owned())));
            }
            let _ = sender.send((place, None));
        };
        match std::thread::Builder::new().spawn(read) {
            Ok(_) => open += 1,
            Err(error) => {
                let _ = child.kill(); // it may have ended just now
                let _ = child.wait();
                return (String::new(), Some(format!("cannot be tried: {error}")));
            }
        }
    }
    let mut texts = [String::new(), String::new()];
    let (begin, mut patience, mut late) = (Instant::now(), PATIENCE_TO_LIST, None);
    while open > 0 {
        match said.recv_timeout((begin + patience).saturating_duration_since(Instant::now())) {
            Ok((place, Some(line))) => {
                if place == 0 && line.starts_with("listed") {
                    patience = PATIENCE;
                }
                texts[place] += &(line + "\n");
            }
            Ok((_, None)) => open -= 1,
            Err(_) if late.is_none() => {
                late = Some(patience);
                let _ = child.kill(); // as above
                patience = begin.elapsed() + Duration::from_secs(1); // for what it said before
            }
            Err(_) => break,
        }
    }
    let [facts, words] = texts;
    let status = child.wait();
    let words = last_words(&words);
    let why = match (status, late) {
        (_, Some(patience)) => Some(format!("does not answer for {} s{words}", patience.as_secs())),
        (Ok(status), None) if status.success() => None,
        (Ok(status), None) => Some(format!("{}{words}", ending(status))),
        (Err(error), None) => Some(format!("cannot be waited for: {error}")),
    };
    (facts, why)
}

/// How a process ended.
fn ending(status: ExitStatus) -> String {
    #[cfg(unix)]
    {
        use std::os::unix::process::ExitStatusExt as _;
        if let Some(signal) = status.signal() {
            let name = signal_hook::low_level::signal_name(signal).unwrap_or("a signal");
            let aborted = if signal == signal_hook::consts::SIGABRT { "aborts" } else { "crashes" };
            return format!("{aborted} ({name})");
        }
    }
    format!("ends the program ({status})")
}

/// The last lines that a driver wrote.
fn last_words(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(3)..];
    if last.is_empty() { String::new() } else { format!(": {}", last.join("; ")) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_child_says_is_taken_in() {
        let mut known = Known::default();
        assert_eq!(known.take(""), None);
        assert!(!known.listed);
        assert_eq!(known.take("listed 3\ntrying 0\nfails 0 no | kernel\ntrying 1\n"), Some(1), "it never answered");
        assert!(known.listed);
        assert_eq!(known.devices[&0], Err("no\nkernel".into()));
        assert_eq!(known.take("chatter\nlisted 3\ntrying 2\nworks 2"), None);
        assert_eq!(known.devices[&2], Ok(()));
        assert!(!known.devices.contains_key(&1));
    }

    #[cfg(unix)]
    #[test]
    fn how_a_child_ends_is_told() {
        let run = |script: &str| {
            let mut shell = Command::new("sh");
            listen(shell.args(["-c", script]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap())
        };
        assert_eq!(run("echo listed 1"), ("listed 1\n".into(), None));
        let (_, why) = run("echo 'no linker' >&2; kill -ABRT $$");
        assert_eq!(why.unwrap(), "aborts (SIGABRT): no linker");
        assert!(run("kill -SEGV $$").1.unwrap().starts_with("crashes (SIGSEGV)"));
        assert!(run("exit 3").1.unwrap().contains("exit status: 3"));
    }
}
