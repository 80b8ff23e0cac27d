//! placeholder
use super::Scene;
/// Where and why.
#[derive(Debug, thiserror::Error)]
#[error("x")]
pub struct SceneError {}
/// Reads a file.
pub fn load(_path: &std::path::Path) -> Result<Scene, Box<SceneError>> { todo!() }
/// Parses text.
pub fn parse(_text: &str, _file: &str) -> Result<Scene, Box<SceneError>> { todo!() }
