//! The images that errors are measured against.

use std::path::PathBuf;

use super::Options;
use crate::error::{Error, Result};
use crate::film::Image;
use crate::scene::Scene;

/// The image that a scene is measured against.
pub(super) fn reference(options: &Options, scene: &Scene) -> Result<Image> {
    let path = match &options.reference {
        Some(_) if options.scenes.len() > 1 => {
            return Err(Error::Usage(format!(
                "--reference is one scene's, found {} scenes: name the one that it shows",
                options.scenes.len()
            )));
        }
        Some(path) => path.clone(),
        None => PathBuf::from(format!("tests/golden/{}.exr", scene.name)),
    };
    if options.reference.is_none() && !path.exists() {
        return Err(Error::Usage(format!(
            "{}: no reference image here; name one with --reference FILE (photile reference makes it)",
            path.display()
        )));
    }
    let image = Image::load(&path)?;
    match options.size {
        Some(size) if size != (image.width, image.height) => Err(Error::Usage(format!(
            "{}: {}x{} pixels, --size asks for {}x{}: the picture has its reference's size",
            path.display(),
            image.width,
            image.height,
            size.0,
            size.1
        ))),
        _ => Ok(image),
    }
}
