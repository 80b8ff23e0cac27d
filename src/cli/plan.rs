//! `photile plan`: what is run for a scene, what is skipped, and why.

use serde::Serialize;

use super::options::RenderOptions;
use super::print_json;
use crate::error::{Error, Result};
use crate::features::{Features, Reason};
use crate::layout::{Frame, Glass, Light, Object, Record, Shape, TEXEL, TEXTURE_WIDTH_LOG2};
use crate::pack::Packed;
use crate::source::{Options, assemble, units};

/// Show which stages and features a scene needs, what is skipped and why
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    options: RenderOptions,
    /// Print a shader or kernel as the driver gets it, such as trace.frag or trace.cl
    #[arg(long, value_name = "UNIT")]
    source: Option<String>,
    /// Lanes of a work-item in a printed kernel: 1 as for GPUs, 4, 8 or 16 as for CPUs
    #[arg(long, value_name = "N", default_value_t = 1, requires = "source")]
    lanes: u32,
    /// Print one JSON object on stdout
    #[arg(long)]
    json: bool,
}

/// A table on the device.
#[derive(Serialize)]
struct Table {
    table: &'static str,
    records: usize,
    texels: usize,
    texture: [u32; 2],
    bytes: usize,
}

#[derive(Serialize)]
struct Report {
    scene: String,
    permutation: Vec<&'static str>,
    features: Vec<Reason>,
    uploads: Vec<Table>,
    bytes: usize,
}

pub fn run(args: &Args) -> Result<()> {
    let scene = args.options.load()?;
    let settings = args.options.settings(&scene);
    let (features, reasons) = Features::explain(&scene, &settings);
    if let Some(unit) = &args.source {
        if !units().contains(&unit.as_str()) {
            return Err(Error::Usage(format!("found --source {unit}, expected one of {}", units().join(", "))));
        }
        if ![1, 4, 8, 16].contains(&args.lanes) {
            return Err(Error::Usage(format!("found --lanes {}, expected 1, 4, 8 or 16", args.lanes)));
        }
        print!("{}", assemble(unit, Some(&features), &Options { lanes: args.lanes, ..Options::default() }).text);
        return Ok(());
    }
    let packed = Packed::new(&scene, scene.camera.position);
    let mut uploads =
        vec![table::<Frame>(1), table::<Object>(packed.objects.len()), table::<Light>(packed.lights.len())];
    if !packed.glasses.is_empty() {
        uploads.push(table::<Glass>(packed.glasses.len()));
    }
    let report = Report {
        scene: scene.name.clone(),
        permutation: features.defines(),
        features: reasons,
        bytes: uploads.iter().map(|t| t.bytes).sum(),
        uploads,
    };
    if args.json {
        print_json(&report);
        return Ok(());
    }
    println!("scene {}: {}", report.scene, report.permutation.join(" "));
    for reason in &report.features {
        println!("  {} {:<20} {}", if reason.used { "used   " } else { "skipped" }, reason.feature, reason.why);
    }
    println!("uploads");
    for Table { table, records, texels, texture, bytes } in &report.uploads {
        println!(
            "  {table:<8} {records:>8} records {texels:>8} texels {bytes:>10} bytes, texture {} × {}",
            texture[0], texture[1]
        );
    }
    println!("  {} bytes in all", report.bytes);
    Ok(())
}

fn table<R: Record>(records: usize) -> Table {
    let texels = records * R::TEXELS;
    let shape = Shape::of(texels, TEXTURE_WIDTH_LOG2);
    Table { table: R::TABLE, records, texels, texture: [shape.width, shape.height], bytes: texels * TEXEL * 4 }
}
