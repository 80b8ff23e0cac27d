//! How the lights share a number of paths, and in which directions they can hit anything at all.

use std::sync::LazyLock;

use glam::{DVec3, Vec3};

use crate::error::{Error, Result};
use crate::packing::Packed;
use crate::records::{Emitter, Light};
pub use crate::settings::{Amount, Sampler};
use crate::settings::{LightMode, Pass, Settings};
use crate::shapes::{Cap, Shapes, sheet_of};

mod caps;

use caps::{caps, cones};

/// What one pass emits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Emission {
    /// How long.
    pub amount: Amount,
    /// Keys every random number, with `pass`.
    pub seed: u32,
    /// Number of the pass.
    pub pass: u32,
    /// Where the first numbers come from.
    pub sampler: Sampler,
    /// Also store photons straight from the light; `hybrid` leaves those to shadow rays.
    pub store_direct: bool,
}

impl Emission {
    /// Of a pass at these settings.
    pub fn of(settings: &Settings, pass: &Pass) -> Emission {
        Emission {
            amount: settings.photons.amount,
            seed: pass.seed,
            pass: pass.index,
            sampler: settings.photons.sampler,
            store_direct: settings.light == LightMode::Photons,
        }
    }
}

/// Rows of an emission map: equal ranges of the height on the unit sphere, from the top (y = 1) down.
pub const ROWS_LOG2: u32 = 6;
/// Columns of an emission map: equal parts of the turn about y.
pub const COLUMNS_LOG2: u32 = 7;
/// Cells of the whole sphere, all of equal solid angle.
pub const CELLS: usize = 1 << (ROWS_LOG2 + COLUMNS_LOG2);
/// Bits of an entry of the emission map that name its cell.
pub const CELL_BITS: u32 = ROWS_LOG2 + COLUMNS_LOG2;
/// Bits that tell how many parts, of equal solid angle, the cell is divided into; and which of them this entry is.
pub const PART_BITS: u32 = 9;

/// An entry of an emission map: part `part` of the `parts` of a cell.
pub fn entry(cell: u32, parts: u32, part: u32) -> u32 {
    cell | parts << CELL_BITS | part << (CELL_BITS + PART_BITS)
}

/// The lights' shares of the paths. A round of `1 << slots_log2` paths serves each light in proportion to the flux
/// that can hit something, in an order in which any part of a round is as well shared as it can be.
#[derive(Clone, Debug, PartialEq)]
pub struct EmissionPlan {
    /// Paths of a round, as a power of two.
    pub slots_log2: u32,
    /// By slot: light `<< slots_log2` | rank of the slot among the light's own.
    pub slots: Vec<u32>,
    /// By light: slots of a round, first entry of the emission map, number of entries.
    pub counts: Vec<[u32; 3]>,
    /// The emission map, light by light: cells of the sphere of directions in which something can be hit, ascending,
    /// each divided into as many parts as it is worth (see [`entry`]). Every entry gets equally many paths, whose power
    /// is in proportion to the part's solid angle. Empty when something can be hit everywhere, by every light.
    pub cells: Vec<u32>,
    /// By light: position, and flux into its cells (W per channel).
    lights: Vec<([f32; 3], DVec3)>,
}

impl EmissionPlan {
    /// For a packed scene.
    ///
    /// # Errors
    /// [`Error::Usage`] for more lights than slots can name.
    pub fn new(packed: &Packed) -> Result<EmissionPlan> {
        let shapes = Shapes::unpacked(&packed.shapes, &packed.quads);
        EmissionPlan::with_cells(packed, |light| caps(&shapes, light))
    }

    /// The plan that suits what is stored.
    ///
    /// # Errors
    /// As [`EmissionPlan::new`].
    pub fn of(packed: &Packed, store_direct: bool) -> Result<EmissionPlan> {
        if store_direct { EmissionPlan::new(packed) } else { EmissionPlan::indirect(packed) }
    }

    /// The same where photons straight from the light are not stored: directions get more paths where their light
    /// goes on to another surface. In a room, where it does so everywhere, that changes nothing.
    ///
    /// # Errors
    /// As [`EmissionPlan::new`].
    pub fn indirect(packed: &Packed) -> Result<EmissionPlan> {
        let mut plan = EmissionPlan::new(packed)?;
        if !plan.cells.is_empty() {
            plan.weigh(packed);
        }
        Ok(plan)
    }

    /// Divides cells into parts, by what their light is worth.
    fn weigh(&mut self, packed: &Packed) {
        let kept = std::mem::take(&mut self.cells);
        let shapes = Shapes::unpacked(&packed.shapes, &packed.quads);
        for (light, counts) in self.counts.iter_mut().enumerate() {
            let own = &kept[counts[1] as usize..(counts[1] + counts[2]) as usize];
            let cells = own.iter().map(|entry| entry & (CELLS as u32 - 1));
            let position = DVec3::from(packed.lights[light].position.map(f64::from));
            // The variance of a sum of what is mostly nothing is least where directions are chosen by the root of how
            // often it is something (Rubinstein 1981, on importance sampling).
            let worths: Vec<f64> = cells.clone().map(|cell| worth(packed, &shapes, position, cell).sqrt()).collect();
            let mean = worths.iter().sum::<f64>() / worths.len().max(1) as f64;
            counts[1] = self.cells.len() as u32;
            for (cell, worth) in cells.zip(&worths) {
                // A quarter is shared out evenly: the worth is an estimate, and power is never more than fourfold.
                let share = if mean > 0.0 { 0.25 + 0.75 * worth / mean } else { 1.0 };
                let parts = ((PARTS * share).round() as u32).clamp(1, (1 << PART_BITS) - 1);
                self.cells.extend((0..parts).map(|part| entry(cell, parts, part)));
            }
            counts[2] = self.cells.len() as u32 - counts[1];
        }
    }

    /// For a packed scene, without the map: paths leave in all directions.
    ///
    /// # Errors
    /// As [`EmissionPlan::new`].
    pub fn whole_sphere(packed: &Packed) -> Result<EmissionPlan> {
        EmissionPlan::with_cells(packed, |_| None)
    }

    fn with_cells(packed: &Packed, caps: impl Fn(DVec3) -> Option<Vec<Cap>>) -> Result<EmissionPlan> {
        let lights = packed.lights.len();
        // Four slots a light at least, so that a share is off by an eighth at most; the power of a path makes up for it.
        let slots_log2 = (4 * lights).next_power_of_two().trailing_zeros().max(12);
        if lights > 1 << (32 - slots_log2) {
            return Err(Error::Usage(format!("{lights} lights: at most 32768 can emit photons")));
        }
        let mut plan =
            EmissionPlan { slots_log2, slots: Vec::new(), counts: Vec::new(), cells: Vec::new(), lights: Vec::new() };
        // Directions first: flux that can hit nothing gets no paths.
        for light in &packed.lights {
            let first = plan.cells.len();
            let position = DVec3::from(light.position.map(f64::from));
            let caps = caps(position);
            let kept = |cell: &u32| {
                let cone = &cones()[*cell as usize];
                caps.as_ref().is_none_or(|caps| caps.iter().any(|cap| cone.meets(cap)))
            };
            plan.cells.extend((0..CELLS as u32).filter(kept).map(|cell| entry(cell, 1, 0)));
            let kept = plan.cells.len() - first;
            plan.counts.push([0, first as u32, kept as u32]);
            let flux = DVec3::from(light.intensity.map(f64::from)) * (4.0 * std::f64::consts::PI);
            plan.lights.push((light.position, flux * (kept as f64 / CELLS as f64)));
        }
        if plan.cells.len() == lights * CELLS {
            plan.cells.clear();
        }
        plan.share_slots();
        Ok(plan)
    }

    /// Gives each light its slots: largest remainders, one at least, then spread evenly over the round.
    fn share_slots(&mut self) {
        let flux: Vec<f64> = self.lights.iter().map(|(_, flux)| flux.element_sum()).collect();
        let total: f64 = flux.iter().sum();
        if total <= 0.0 {
            return;
        }
        let slots = 1u32 << self.slots_log2;
        for (counts, flux) in self.counts.iter_mut().zip(&flux) {
            counts[0] = if *flux > 0.0 { ((flux / total * f64::from(slots)).round() as u32).max(1) } else { 0 };
        }
        // Rounding leaves some over or short: the lights with most slots notice it least.
        let mut largest: Vec<usize> = (0..flux.len()).collect();
        largest.sort_by_key(|light| std::cmp::Reverse(self.counts[*light][0]));
        for light in largest.iter().cycle() {
            let given: u32 = self.counts.iter().map(|c| c[0]).sum();
            if given == slots {
                break;
            }
            let counts = &mut self.counts[*light][0];
            *counts = if given < slots { *counts + 1 } else { (*counts).max(2) - 1 };
        }
        let mut order: Vec<(f64, u32)> = Vec::new();
        for (light, counts) in self.counts.iter().enumerate() {
            let place = |rank: u32| (f64::from(rank) + 0.5) / f64::from(counts[0]);
            order.extend((0..counts[0]).map(|rank| (place(rank), (light as u32) << self.slots_log2 | rank)));
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        self.slots = order.into_iter().map(|(_, slot)| slot).collect();
    }

    /// The light that a path starts from.
    pub fn light_of(&self, path: u32) -> u32 {
        self.slots[(path & ((1 << self.slots_log2) - 1)) as usize] >> self.slots_log2
    }

    /// Whether no path can hit anything.
    pub fn is_empty(&self) -> bool {
        self.slots.is_empty()
    }

    /// Share of the lights' flux that leaves in directions where something can be hit: without the map, the rest of
    /// the paths would be wasted.
    pub fn useful_share(&self, packed: &Packed) -> f64 {
        let kept: f64 = self.lights.iter().map(|(_, flux)| flux.element_sum()).sum();
        let all: f64 = packed.lights.iter().flat_map(|l| l.intensity).map(f64::from).sum();
        if all > 0.0 { kept / (4.0 * std::f64::consts::PI * all) } else { 0.0 }
    }

    /// Paths of each light among the first `paths`.
    pub fn paths_of_lights(&self, paths: u32) -> Vec<u64> {
        let rounds = u64::from(paths >> self.slots_log2);
        let mut count: Vec<u64> = self.counts.iter().map(|c| rounds * u64::from(c[0])).collect();
        for slot in self.slots.iter().take((paths & ((1 << self.slots_log2) - 1)) as usize) {
            count[(slot >> self.slots_log2) as usize] += 1;
        }
        count
    }

    /// The records for `paths` paths: each light's flux over its own number of paths, so that the emitted energy is
    /// exact. Too few paths to serve every light: over the number to be expected, right in the mean only.
    pub fn emitters(&self, paths: u32) -> Vec<Emitter> {
        let own = self.paths_of_lights(paths);
        let served = own.iter().zip(&self.counts).all(|(own, counts)| *own > 0 || counts[0] == 0);
        let mut emitters = Vec::new();
        for (light, (position, flux)) in self.lights.iter().enumerate() {
            let slots = self.counts[light][0];
            let expected = f64::from(paths) * f64::from(slots) / f64::from(1u32 << self.slots_log2);
            let number = if served { own[light] as f64 } else { expected };
            // Of a cell that is one part: kernels divide by the number of its parts.
            let [_, first, entries] = self.counts[light];
            let own = self.cells.get(first as usize..(first + entries) as usize).unwrap_or(&[]);
            let cells = own.iter().filter(|entry| *entry >> (CELL_BITS + PART_BITS) == 0).count();
            let largest = flux.max_element();
            let a_cell = if cells > 0 { f64::from(entries) / cells as f64 } else { 1.0 };
            let color = if largest > 0.0 { (*flux / largest).as_vec3() } else { Vec3::ZERO };
            let power = if slots == 0 || paths == 0 { 0.0 } else { (largest * a_cell / number) as f32 };
            emitters.push(Emitter { position: *position, color: color.to_array(), power, ..Emitter::default() });
        }
        emitters
    }
}

/// Power in whole quanta, so that sums of photons do not depend on their order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quanta {
    /// Quanta of a watt.
    pub per_watt: f32,
    /// A quantum, watts.
    pub watts: f32,
}

impl Quanta {
    /// Quanta so small that 32 bits just hold all photons of `paths` paths in one place, 16 of each.
    pub fn of(emitters: &[Emitter], paths: u32) -> Quanta {
        let largest = emitters.iter().map(|e| e.power).fold(0.0, f32::max);
        // What a quantum could not be told of is dark; of 1e-34 W it is the last that float32 holds the inverse of.
        if largest < 1e-34 {
            return Quanta { per_watt: 0.0, watts: 0.0 };
        }
        // A power of two: dividing by it is exact.
        let of_a_photon = ((1u64 << 28) / u64::from(paths).next_power_of_two()).clamp(1, 1 << 14) as f32;
        Quanta { per_watt: of_a_photon / largest, watts: largest / of_a_photon }
    }
}

/// Parts that a cell of mean worth is divided into.
const PARTS: f64 = 4.0;

/// Of the light that leaves through a cell, how much meets another surface after the first one: from the cell's axis,
/// for diffuse and mirrored directions alike.
fn worth(packed: &Packed, shapes: &Shapes, light: DVec3, cell: u32) -> f64 {
    let axis = cones()[cell as usize].axis;
    let Some((shape, point)) = shapes.nearest(light, axis) else { return 0.0 };
    let (normal, material) = (sheet_of(&packed.shapes[shape]).normal(point), packed.material_of(shape));
    let normal = if normal.dot(axis) > 0.0 { -normal } else { normal };
    let albedo = f64::from(material.color.iter().copied().fold(0.0, f32::max) * material.diffuse);
    // Directions of density cos/π: the normal plus points of the unit sphere.
    let directions = directions(shapes.len());
    let goes_on = directions.iter().filter(|on_sphere| {
        let direction = normal + **on_sphere;
        shapes.is_met(point, direction.normalize_or(normal), Some(shape))
    });
    let diffuse = albedo * goes_on.count() as f64 / directions.len() as f64;
    let mirrored = axis - normal * (2.0 * axis.dot(normal));
    let glossy = f64::from(material.specular);
    diffuse + if glossy > 0.0 && shapes.is_met(point, mirrored, Some(shape)) { glossy } else { 0.0 }
}

/// Point `i` of `count` on the unit sphere, on a spiral (Vogel 1979).
fn on_sphere(i: u32, count: u32) -> DVec3 {
    let height = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
    let (sine, cosine) = (f64::from(i) * 2.399_963).sin_cos();
    let radius = (1.0 - height * height).sqrt();
    DVec3::new(radius * cosine, height, radius * sine)
}

/// Whether light of every lamp meets something in each of many directions. A guess, but a quick one.
pub fn is_closed(packed: &Packed) -> bool {
    const LOOKED_AT: u32 = 256;
    let shapes = Shapes::unpacked(&packed.shapes, &packed.quads);
    let meets = |light: &Light, i: u32| {
        shapes.is_met(DVec3::from(light.position.map(f64::from)), on_sphere(i, LOOKED_AT), None)
    };
    packed.lights.iter().all(|light| (0..LOOKED_AT).all(|i| meets(light, i)))
}

/// Directions that a surface's light is followed in.
const DIRECTIONS: u32 = 64;
/// Objects from which on directions become fewer: a lamp that moves waits for all of them.
const MANY: u32 = 64;

fn directions(shapes: usize) -> &'static [DVec3] {
    static POINTS: LazyLock<Vec<Vec<DVec3>>> = LazyLock::new(|| {
        let points = |count| (0..count).map(|i| on_sphere(i, count)).collect();
        (0..=DIRECTIONS).map(points).collect()
    });
    let count = DIRECTIONS * MANY / (shapes as u32).max(MANY);
    &POINTS[count.max(8) as usize]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::parse;

    #[test]
    fn caps_leave_no_direction_out_in_which_something_is_hit() {
        for name in ["sphere_and_plane", "many_spheres"] {
            let scene = crate::scene::load(std::path::Path::new(&format!("scenes/{name}.toml"))).expect("ours");
            let packed = Packed::new(&scene, scene.camera.position);
            let light = DVec3::from(packed.lights[0].position.map(f64::from));
            let shapes = Shapes::unpacked(&packed.shapes, &packed.quads);
            let caps = caps(&shapes, light).expect("the light lies in no object");
            let (mut hit, mut kept) = (0, 0);
            for cell in cones() {
                let is_kept = caps.iter().any(|cap| cell.meets(cap));
                let is_hit = shapes.is_met(light, cell.axis, None);
                assert!(is_kept || !is_hit, "{name}: {:?}", cell.axis);
                (hit, kept) = (hit + usize::from(is_hit), kept + usize::from(is_kept));
            }
            // And few more than it must: those that an object's border goes through.
            assert!(hit > 0 && kept < CELLS && (kept - hit) * 20 < CELLS, "{name}: {hit} {kept}");
        }
    }

    #[test]
    fn the_map_is_the_same_at_any_scale() {
        let cells = |scale: f64| {
            let text = format!(
                "[camera]\nposition = [0, 0, {}]\nlook_at = [0, 0, 0]\n[materials.m]\ncolor = [1, 1, 1]\n\
                 [[lights]]\nposition = [{}, {}, 0]\nintensity = [1, 1, 1]\n\
                 [[planes]]\nnormal = [0, 1, 0]\noffset = {}\nmaterial = \"m\"\n\
                 [[spheres]]\ncenter = [0, 0, 0]\nradius = {}\nmaterial = \"m\"\n",
                8.0 * scale,
                -6.0 * scale,
                6.0 * scale,
                -4.0 * scale,
                2.0 * scale
            );
            let scene = parse(&text, "scaled").unwrap();
            EmissionPlan::indirect(&Packed::new(&scene, scene.camera.position)).unwrap().cells
        };
        let here = cells(1.0);
        assert!(here.iter().any(|entry| entry >> CELL_BITS & ((1 << PART_BITS) - 1) > 1), "nothing is worth more");
        // Powers of two change no digit.
        for exponent in [-30, 20, 30] {
            assert!(cells(2f64.powi(exponent)) == here, "scale 2^{exponent}");
        }
    }
}
