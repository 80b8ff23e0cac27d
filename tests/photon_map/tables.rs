//! The device's tables are the twin's, bit for bit.

use photile::cpu::grid::{GridTables, grid};
use photile::device::cl::Context;
use photile::plan::cells::{CellSize, Form};
use photile::records::TEXEL;
use photile::stage::grid::{GridSettings, GridStage};
use photile::stage::photon_map::first;

use super::{Map, Random, device, like_a_gpu, room, room_photons, upload};

/// What the device made, without the order, which it keeps to itself.
fn built(context: &Context, stage: &mut GridStage, map: &Map, wanted: &GridSettings) -> GridTables {
    let uploaded = upload(context, map);
    let grid = stage.build(context, &room(), uploaded, wanted).unwrap();
    let sorted = grid.sorted.as_ref().unwrap();
    assert_eq!(grid.cell_starts.len() % TEXEL, 0, "a list is whole texels");
    let count = map.len();
    let tables = GridTables {
        order: Vec::new(),
        cell_starts: first(context, &grid.cell_starts, grid.plan.cells + 1).unwrap(),
        positions: first(context, &sorted.positions, count).unwrap(),
        powers: first(context, &sorted.powers, count).unwrap(),
        directions: sorted.directions.as_ref().map_or(Vec::new(), |d| first(context, d, count).unwrap()),
    };
    // And back: what was stored, byte for byte, in the order in which it was stored.
    let restored = stage.restore(context).unwrap().unwrap();
    assert!(stage.restore(context).unwrap().is_none(), "it was taken");
    assert!(first(context, &restored.positions, count).unwrap() == map.positions);
    assert!(first(context, &restored.powers, count).unwrap() == map.powers);
    assert!(restored.directions.is_none_or(|d| first(context, &d, count).unwrap() == map.directions));
    tables
}

fn check(context: &Context, stage: &mut GridStage, map: &Map, wanted: &GridSettings) {
    let found = built(context, stage, map, wanted);
    let plan = map.plan(&room(), wanted.radius, wanted.size, wanted.form);
    let expected = GridTables { order: Vec::new(), ..grid(&map.tables(), &plan) };
    let what = format!("{} photons, {wanted:?}", map.len());
    // Integers exactly, floats by their bits: they were moved, not computed.
    assert_eq!(found.cell_starts, expected.cell_starts, "{what}");
    assert!(found.positions == expected.positions && found.powers == expected.powers, "{what}");
    assert!(found.directions == expected.directions, "{what}");
    assert_eq!(found, built(context, stage, map, wanted), "{what}: another run, other bytes");
}

fn wanted(radius: f32, form: Form) -> GridSettings {
    GridSettings { form, ..GridSettings::radius(radius) }
}

const FORMS: [Form; 4] = [Form::Auto, Form::Dense, Form::Hashed(None), Form::Hashed(Some(8))];

#[test]
fn device_and_twin_build_the_same_tables() {
    build_the_same_tables(&device());
}

#[test]
fn work_groups_build_the_twins_tables() {
    build_the_same_tables(&like_a_gpu());
}

fn build_the_same_tables(context: &Context) {
    let mut stage = GridStage::new(context).unwrap();
    // One stage for all: buffers that once held more must not shine through.
    for count in [100_000, 20_000, 1000, 17, 2, 1, 0] {
        let map = room_photons(count, count as u32);
        for form in FORMS {
            check(context, &mut stage, &map, &wanted(0.3, form));
        }
    }
}

#[test]
fn hard_maps_build_alike() {
    build_hard_maps_alike(&device());
}

#[test]
fn work_groups_build_hard_maps_alike() {
    build_hard_maps_alike(&like_a_gpu());
}

fn build_hard_maps_alike(context: &Context) {
    let mut stage = GridStage::new(context).unwrap();
    let mut random = Random::new(5);
    let mut heap = room_photons(1000, 6);
    for _ in 0..20_000 {
        heap.push([-1.25, -2.0, -0.75], 4, 1.0, &mut random);
    }
    let mut borders = Map::default();
    for i in -2000..2000 {
        borders.push([i as f32 * 0.25, -2.0, i as f32 * -0.25], 4, 1.0, &mut random);
        borders.push([-3.0, i as f32 * 0.25, -0.0], 2, -1.0, &mut random);
    }
    let mut far = room_photons(1000, 7);
    for i in 1..100 {
        far.push([(i * i) as f32 * 1e5, -2.0, -1e7], 4, 1.0, &mut random);
    }
    for map in [heap, borders, far] {
        for form in [Form::Auto, Form::Hashed(None), Form::Hashed(Some(8))] {
            check(context, &mut stage, &map, &wanted(0.5, form));
        }
    }
    let counts = GridSettings { size: CellSize::Counts([60, 40, 40]), ..GridSettings::radius(1.0) };
    check(context, &mut stage, &room_photons(12_000, 8), &counts);
}
