//! `photile validate`: does every field arrive on every device?

use std::collections::BTreeMap;

use serde::Serialize;

use super::options::parse_device;
use super::{notice, print_json};
use crate::device::gl::Headless;
use crate::error::{Error, Result};
use crate::pipeline::open_device;
use crate::records::is_field;
use crate::stress::validate::{Check, Readers, validate};

/// Check the packing: upload every kind of record and read each field back, on every device
#[derive(clap::Args)]
pub struct Args {
    /// Break one field's offset, such as object.color: the check must then fail
    #[arg(long, value_name = "FIELD")]
    inject: Option<String>,
    /// OpenCL device to use: its number as doctor counts them, such as #2 or 2, or part of its name
    #[arg(long, value_name = "DEVICE", value_parser = parse_device)]
    device: Option<String>,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Report {
    opengl: Option<String>,
    opencl: Option<String>,
    values: usize,
    wrong: Vec<String>,
    checks: Vec<Check>,
}

pub fn run(args: &Args) -> Result<()> {
    if let Some(field) = args.inject.as_deref().filter(|field| !is_field(field)) {
        return Err(Error::Usage(format!("found --inject {field}, expected record.field, such as object.color")));
    }
    let missing = |error: Error| notice(&format!("not checked: {error}"));
    let readers = Readers {
        gl: Headless::new().map_err(missing).ok(),
        cl: open_device(args.device.as_deref(), &mut notice).map_err(missing).ok(),
    };
    if !args.json {
        say!("{:<8} {:<10} {:>9} {:>6} {:>12}", "record", "read by", "records", "width", "values");
    }
    let checks = validate(&readers, args.inject.as_deref(), |check| {
        if !args.json {
            let Check { record, path, count, width_log2, values, wrong } = check;
            let path = format!("{path:?}");
            let width = width_log2.map_or("-".to_string(), |w| (1u32 << w).to_string());
            let verdict = wrong.as_ref().map_or("same bits", |_| "WRONG");
            say!("{record:<8} {path:<10} {count:>9} {width:>6} {values:>12}  {verdict}");
        }
    })?;
    let wrong: Vec<String> =
        checks.iter().filter_map(|c| Some(format!("{:?}: {}", c.path, c.wrong.as_ref()?))).collect();
    let report = Report {
        opengl: readers.gl.as_ref().map(|gl| gl.renderer.clone()),
        opencl: readers.cl.as_ref().map(|cl| cl.device.name.clone()),
        values: checks.iter().map(|c| c.values).sum(),
        wrong,
        checks,
    };
    if args.json {
        print_json(&report);
    } else {
        let mut by_path = BTreeMap::<String, usize>::new();
        for check in &report.checks {
            *by_path.entry(format!("{:?}", check.path)).or_default() += check.values;
        }
        let sums: Vec<String> = by_path.iter().map(|(path, values)| format!("{path} {values}")).collect();
        say!("{} values compared ({})", report.values, sums.join(", "));
    }
    match report.wrong.first() {
        None => Ok(()),
        Some(first) => Err(Error::Failed(format!("{} checks failed; the first: {first}", report.wrong.len()))),
    }
}
