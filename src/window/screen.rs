//! Which window system is taken.

use winit::event_loop::EventLoopBuilder;

/// Lets X11 be taken where Wayland is named and is not there: a variable of a session that has ended, beside a display that
/// works. The window library takes Wayland wherever it is named, and cannot be asked twice.
#[cfg(all(unix, not(target_vendor = "apple")))]
pub fn choose<T: 'static>(builder: &mut EventLoopBuilder<T>) {
    use winit::platform::x11::EventLoopBuilderExtX11 as _;
    if is_set("DISPLAY") && is_set("WAYLAND_DISPLAY") && !is_set("WAYLAND_SOCKET") && !wayland_answers() {
        builder.with_x11();
    }
}

/// As above: there is one window system here.
#[cfg(not(all(unix, not(target_vendor = "apple"))))]
pub fn choose<T: 'static>(_: &mut EventLoopBuilder<T>) {}

#[cfg(all(unix, not(target_vendor = "apple")))]
fn is_set(name: &str) -> bool {
    std::env::var_os(name).is_some_and(|value| !value.is_empty())
}

/// Whether somebody listens where the variables say, as Wayland's own library reads them.
#[cfg(all(unix, not(target_vendor = "apple")))]
fn wayland_answers() -> bool {
    let name = std::path::PathBuf::from(std::env::var_os("WAYLAND_DISPLAY").unwrap_or_default());
    let socket = match std::env::var_os("XDG_RUNTIME_DIR") {
        Some(directory) => std::path::Path::new(&directory).join(name), // a whole path stays what it is
        None => name,
    };
    std::os::unix::net::UnixStream::connect(socket).is_ok()
}
