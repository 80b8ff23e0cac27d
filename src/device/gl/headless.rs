//! OpenGL without a display: EGL by device (NVIDIA and others, Mesa too) or surfaceless (Mesa).

use std::ffi::{CStr, c_char, c_void};
use std::rc::Rc;

use glow::HasContext;
use khronos_egl as egl;

use super::current::is_software;
use super::{Current, Functions, MISSING};
use crate::device::cl::aborts::Driver;
use crate::error::{Error, Result};

type Egl = egl::DynamicInstance<egl::EGL1_5>;

// From EGL_EXT_platform_device, EGL_MESA_platform_surfaceless and EGL_EXT_device_query.
const PLATFORM_DEVICE: egl::Enum = 0x313F;
const PLATFORM_SURFACELESS: egl::Enum = 0x31DD;
const EXTENSIONS: egl::Int = 0x3055;
type QueryDevices = extern "system" fn(egl::Int, *mut *mut c_void, *mut egl::Int) -> egl::Boolean;
type QueryDeviceString = extern "system" fn(*mut c_void, egl::Int) -> *const c_char;

/// A current OpenGL 3.3 core context that draws into textures only.
pub struct Headless {
    egl: Rc<Egl>,
    display: egl::Display,
    context: egl::Context,
    /// Functions of this context.
    pub gl: Functions,
    /// The device and driver, as GL_RENDERER names them.
    pub renderer: String,
    /// The version of OpenGL, as GL_VERSION says it.
    pub version: String,
    /// `EGL device 0` or `EGL surfaceless`.
    pub route: String,
    /// Rasterised by the CPU.
    pub is_software: bool,
}

/// A way to a display that can be tried.
struct Candidate {
    route: String,
    platform: egl::Enum,
    native: *mut c_void,
}

impl Headless {
    /// Opens the first context on a GPU, else the first at all; the last attempt's error when there is none.
    ///
    /// # Errors
    /// [`Error::Driver`] with what is missing and which package brings it.
    pub fn new() -> Result<Headless> {
        let egl = load()?;
        let mut software = None;
        let mut why = String::new();
        for candidate in candidates(&egl) {
            match Headless::open(&egl, &candidate) {
                Ok(context) if !context.is_software => return Ok(context),
                Ok(context) => {
                    software.get_or_insert(candidate);
                    drop(context);
                }
                Err(error) => why = format!(" ({error})"),
            }
        }
        match software {
            Some(candidate) => Headless::open(&egl, &candidate),
            None => Err(Error::Driver(format!("{MISSING}{why}"))),
        }
    }

    fn open(egl: &Rc<Egl>, candidate: &Candidate) -> Result<Headless> {
        let failed = |what: &str, error: egl::Error| Error::Driver(format!("{}: {what}: {error}", candidate.route));
        // SAFETY: the native handle is EGL's own device, or the default display; the attribute list is terminated.
        let display = unsafe { egl.get_platform_display(candidate.platform, candidate.native, &[egl::ATTRIB_NONE]) }
            .map_err(|e| failed("no display", e))?;
        egl.initialize(display).map_err(|e| failed("no initialisation", e))?;
        egl.bind_api(egl::OPENGL_API).map_err(|e| failed("no OpenGL", e))?;
        let config = egl
            .choose_first_config(
                display,
                &[egl::SURFACE_TYPE, egl::PBUFFER_BIT, egl::RENDERABLE_TYPE, egl::OPENGL_BIT, egl::NONE],
            )
            .map_err(|e| failed("no configuration", e))?
            .ok_or_else(|| Error::Driver(format!("{}: no configuration for OpenGL", candidate.route)))?;
        let attributes = [
            egl::CONTEXT_MAJOR_VERSION,
            3,
            egl::CONTEXT_MINOR_VERSION,
            3,
            egl::CONTEXT_OPENGL_PROFILE_MASK,
            egl::CONTEXT_OPENGL_CORE_PROFILE_BIT,
            egl::NONE,
        ];
        let context = egl
            .create_context(display, config, None, &attributes)
            .map_err(|e| failed("no OpenGL 3.3 core context", e))?;
        egl.make_current(display, None, None, Some(context)).map_err(|e| failed("no surfaceless context", e))?;
        // SAFETY: the context was made current above, and EGL returns its functions.
        let gl = unsafe {
            glow::Context::from_loader_function(|name| {
                egl.get_proc_address(name).map_or(std::ptr::null(), |f| f as *const c_void)
            })
        };
        // SAFETY: the context is current.
        let (renderer, version) =
            unsafe { (gl.get_parameter_string(glow::RENDERER), gl.get_parameter_string(glow::VERSION)) };
        let is_software = is_software(&renderer);
        Ok(Headless {
            egl: Rc::clone(egl),
            display,
            context,
            gl: Rc::new(gl),
            renderer,
            version,
            route: candidate.route.clone(),
            is_software,
        })
    }
}

impl Headless {
    /// What others need that draw here, as long as this context is the thread's current one.
    pub fn current(&self) -> Current {
        let (renderer, version) = (self.renderer.clone(), self.version.clone());
        Current { gl: self.gl.clone(), renderer, version, is_software: self.is_software }
    }

    /// Makes this context the thread's current one: a thread with several has to say which it means.
    ///
    /// # Errors
    /// [`Error::Driver`] when the context is lost.
    pub fn make_current(&self) -> Result<()> {
        self.egl
            .make_current(self.display, None, None, Some(self.context))
            .map_err(|e| Error::Driver(format!("{}: making the context current: {e}", self.route)))
    }
}

impl Drop for Headless {
    fn drop(&mut self) {
        // The display is shared by all contexts of the process and is not terminated here. Errors can only mean that
        // the context is gone already.
        let _ = self.egl.make_current(self.display, None, None, None);
        let _ = self.egl.destroy_context(self.display, self.context);
    }
}

/// Every way to a context, tried: for `photile doctor`.
pub fn contexts() -> Vec<(String, Result<Headless>)> {
    match load() {
        Ok(egl) => candidates(&egl).iter().map(|c| (c.route.clone(), Headless::open(&egl, c))).collect(),
        Err(error) => vec![("EGL".into(), Err(error))],
    }
}

fn load() -> Result<Rc<Egl>> {
    Driver::OpenGl.begin()?;
    // SAFETY: libEGL is the system's; loading it runs no code of ours.
    unsafe { Egl::load_required() }.map(Rc::new).map_err(|error| Error::Driver(format!("{MISSING} ({error})")))
}

/// Devices in the driver's order, then surfaceless.
fn candidates(egl: &Egl) -> Vec<Candidate> {
    let mut found = Vec::new();
    if let (Some(query), Some(describe)) =
        (egl.get_proc_address("eglQueryDevicesEXT"), egl.get_proc_address("eglQueryDeviceStringEXT"))
    {
        // SAFETY: EGL hands out functions of these types under these names (EGL_EXT_device_enumeration, _query).
        let (query, describe) = unsafe {
            (
                std::mem::transmute::<extern "system" fn(), QueryDevices>(query),
                std::mem::transmute::<extern "system" fn(), QueryDeviceString>(describe),
            )
        };
        let mut devices = [std::ptr::null_mut(); 16];
        let mut count = 0;
        query(devices.len() as egl::Int, devices.as_mut_ptr(), &mut count);
        for (number, &device) in devices.iter().take(count.max(0) as usize).enumerate() {
            let extensions = describe(device, EXTENSIONS);
            let extensions = if extensions.is_null() {
                String::new()
            } else {
                // SAFETY: EGL returns a string that lives as long as the library.
                unsafe { CStr::from_ptr(extensions) }.to_string_lossy().into_owned()
            };
            let software = if extensions.contains("software") { ", software" } else { "" };
            found.push(Candidate {
                route: format!("EGL device {number}{software}"),
                platform: PLATFORM_DEVICE,
                native: device,
            });
        }
    }
    found.push(Candidate {
        route: "EGL surfaceless".into(),
        platform: PLATFORM_SURFACELESS,
        native: std::ptr::null_mut(),
    });
    found
}
