//! Rows that a suite of many minutes leaves, and finds again.

use std::fmt::Debug;
use std::path::Path;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::MachineInfo;
use super::table::{Table, Value};
use crate::error::{Error, Result};

/// A file that a run left.
#[derive(Deserialize)]
struct Saved<P, R> {
    machine: SavedMachine,
    settings: P,
    rows: Vec<R>,
}

/// Of a saved machine what rows depend on.
#[derive(Deserialize)]
struct SavedMachine {
    version: String,
    cpu: Option<String>,
    opencl: Option<String>,
    opengl: Option<String>,
}

/// The rows of an earlier run, which must have been this one's.
///
/// # Errors
/// [`Error::File`] where the file cannot be read; [`Error::Usage`] for rows of other settings or of another machine.
pub fn rows<P, R>(path: &Path, plan: &P, machine: &MachineInfo) -> Result<Vec<R>>
where
    P: DeserializeOwned + PartialEq + Debug,
    R: DeserializeOwned,
{
    let refuse = |found: String| {
        Error::Usage(format!(
            "{}: found {found}, expected what this run began; name another directory, or remove the file to begin anew",
            path.display()
        ))
    };
    let text = std::fs::read_to_string(path)
        .map_err(|error| Error::File { path: path.into(), what: format!("cannot read it: {error}") })?;
    let saved: Saved<P, R> =
        serde_json::from_str(&text).map_err(|error| refuse(format!("no rows of this suite ({error})")))?;
    if saved.settings != *plan {
        return Err(refuse(format!("rows of other settings ({:?}, not {plan:?})", saved.settings)));
    }
    let then = (saved.machine.version.as_str(), &saved.machine.cpu, &saved.machine.opencl, &saved.machine.opengl);
    let now = (machine.version, &machine.cpu, &machine.opencl, &machine.opengl);
    if then != now {
        return Err(refuse(format!("another machine's rows ({then:?}, not {now:?})")));
    }
    Ok(saved.rows)
}

/// A plan as a report's settings.
///
/// # Errors
/// [`Error::Failed`] for what JSON cannot hold.
pub fn settings(plan: &impl Serialize) -> Result<serde_json::Value> {
    serde_json::to_value(plan).map_err(|error| Error::Failed(format!("JSON: {error}")))
}

/// A table with a column for each of these fields.
///
/// # Errors
/// [`Error::Failed`] for what JSON cannot hold.
pub fn table<R: Serialize>(rows: &[R], columns: &[&str]) -> Result<Table> {
    let mut table = Table::new(columns.iter().copied());
    for row in rows {
        let fields = settings(row)?;
        table.push(columns.iter().map(|name| Value::from(&fields[*name])));
    }
    Ok(table)
}
