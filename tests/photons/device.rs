//! The device against its twin, and against itself.

use std::rc::Rc;

use photile::cpu::grid::{PhotonSurface, face_of};
use photile::cpu::photons::PhotonTables;
use photile::cpu::scan::exclusive_scan;
use photile::device::cl::{Buffer, Context, devices};
use photile::error::Error;
use photile::rays::emission::{Amount, CELL_BITS, Emission, EmissionPlan, PART_BITS, Sampler};
use photile::records::{PhotonDirection, PhotonPosition, PhotonPower};
use photile::stage::photon_map::{PhotonMap, first};
use photile::stage::photons::Photons;
use photile::stage::scan::Scan;

use super::open_scene::barren;
use super::{Case, grey_box, paths};
use crate::common::one_at_a_time;

/// The first device, with its own number of lanes or another.
fn context(lanes: Option<u32>) -> Rc<Context> {
    let mut device = devices(None).unwrap().remove(0);
    device.lanes = lanes.unwrap_or(device.lanes);
    Rc::new(Context::new(device).unwrap())
}

fn on_device(context: &Rc<Context>, case: &Case, emission: &Emission) -> PhotonTables {
    read(context, &compiled(context, case, emission).emit(emission, None).unwrap())
}

/// The stage, ready for an emission.
fn compiled(context: &Rc<Context>, case: &Case, emission: &Emission) -> Photons {
    let mut stage = Photons::new(Rc::clone(context), Rc::new(Scan::new(context).unwrap()));
    stage.upload(&case.packed, case.plan.clone()).unwrap();
    stage.compile(&case.features, emission).unwrap();
    stage
}

fn read(context: &Context, map: &PhotonMap) -> PhotonTables {
    PhotonTables {
        positions: first(context, &map.positions, map.stored).unwrap(),
        powers: first(context, &map.powers, map.stored).unwrap(),
        surfaces: first(context, &map.faces, map.stored).unwrap().iter().map(surface_of).collect(),
        directions: map.directions.as_ref().map_or(Vec::new(), |d| first(context, d, map.stored).unwrap()),
        emitted: map.emitted,
    }
}

/// Whether two maps are the same, byte for byte.
fn same(a: &PhotonTables, b: &PhotonTables) -> bool {
    let faces = |map: &PhotonTables| map.surfaces.iter().map(face_of).collect::<Vec<_>>();
    let bytes = |map: &PhotonTables| {
        let directions: &[u8] = bytemuck::cast_slice(&map.directions);
        [bytemuck::cast_slice(&map.positions), bytemuck::cast_slice(&map.powers), directions].concat()
    };
    a.emitted == b.emitted && faces(a) == faces(b) && bytes(a) == bytes(b)
}

/// What a face says of a surface.
fn surface_of(face: &f32) -> PhotonSurface {
    let side = if face % 2.0 == 0.0 { 1.0 } else { -1.0 };
    PhotonSurface { shape: (face / 2.0).floor(), side, bounce: f32::NAN }
}

/// Share of the photons that land elsewhere: on another surface, or more than a millimetre away.
///
/// Integers are the same everywhere, but a walk turns rounding (√ and division are within 3 ulps on GPUs) into
/// distances that grow, tenfold where a small sphere lies in between, and a photon next to an edge may land beyond it
/// and walk another way from there.
fn difference(a: &PhotonTables, b: &PhotonTables) -> f64 {
    assert_eq!((a.positions.len(), a.emitted), (b.positions.len(), b.emitted));
    let mut elsewhere = 0;
    for i in 0..a.positions.len() {
        let (p, q) = (glam::Vec3::from(a.positions[i].position), glam::Vec3::from(b.positions[i].position));
        if face_of(&a.surfaces[i]) != face_of(&b.surfaces[i]) || p.distance(q) > 1e-3 {
            // Only the twin counts bounces.
            assert!(b.surfaces[i].bounce > 1.0 || p.distance(q) < 1e-3, "photon {i}, nearly unscattered: {p} for {q}");
            elsewhere += 1;
            continue;
        }
        let (p, q) = (glam::Vec3::from(a.powers[i].power), glam::Vec3::from(b.powers[i].power));
        assert!((p - q).abs().max_element() <= 1e-4 * p.max_element(), "photon {i}: {p} W for {q} W");
    }
    f64::from(elsewhere) / a.positions.len().max(1) as f64
}

#[test]
fn scan_equals_its_twin() {
    one_at_a_time();
    let context = context(None);
    let scan = Scan::new(&context).unwrap();
    for length in [0usize, 1, 2, 15, 16, 17, 2047, 2048, 2049, 4096, 4097, 1_000_003] {
        let mut values: Vec<u32> = (0..length as u32).map(|i| i.wrapping_mul(2_654_435_769) >> 27).collect();
        values.push(0);
        let buffer = Buffer::from_slice(&context, &values).unwrap();
        scan.exclusive(&context, &buffer, values.len()).unwrap();
        exclusive_scan(&mut values);
        assert!(buffer.to_vec(&context).unwrap() == values, "{length} values");
    }
}

#[test]
fn the_device_walks_as_its_twin_does() {
    one_at_a_time();
    // Of one lane: as on a GPU.
    let contexts = [context(None), context(Some(1))];
    for (name, store_direct, sampler) in [
        ("gi_ref", true, Sampler::Sequence),
        ("gi_two_lights", false, Sampler::Sequence),
        ("sphere_and_plane", true, Sampler::Sequence),
        ("glossy", true, Sampler::Random),
    ] {
        let case = Case::shipped(name);
        for number in [1, 15, 16, 17, 20_011] {
            let emission = Emission { store_direct, sampler, ..paths(number) };
            let twin = case.twin(&emission);
            for context in &contexts {
                let elsewhere = difference(&on_device(context, &case, &emission), &twin);
                // See `difference`; bit for bit on PoCL, a few in ten thousand on GPUs.
                assert!(elsewhere <= 1e-3, "{name}, {number} paths: {elsewhere} of the photons lie elsewhere");
            }
        }
    }
}

#[test]
fn the_device_walks_as_its_twin_does_where_directions_are_weighed() {
    one_at_a_time();
    let even = Case::shipped("sphere_and_plane");
    let weighed = Case { plan: EmissionPlan::indirect(&even.packed).unwrap(), ..Case::shipped("sphere_and_plane") };
    let parts = |entry: &u32| entry >> CELL_BITS & ((1 << PART_BITS) - 1);
    assert!(even.plan.cells.iter().all(|entry| parts(entry) == 1));
    assert!(weighed.plan.cells.iter().any(|entry| parts(entry) > 1), "no direction is worth more than another");
    // Of one lane: as on a GPU.
    for context in [context(None), context(Some(1))] {
        for store_direct in [false, true] {
            let emission = Emission { store_direct, ..paths(50_021) };
            let device = on_device(&context, &weighed, &emission);
            let elsewhere = difference(&device, &weighed.twin(&emission));
            // As `the_device_walks_as_its_twin_does`.
            assert!(elsewhere <= 1e-3 && device.len() > 500, "{elsewhere} of {} lie elsewhere", device.len());
            let other = even.twin(&emission);
            assert!(std::panic::catch_unwind(|| difference(&device, &other)).is_err(), "an even share must show");
        }
        let wanted = Emission { amount: Amount::Stored(2000), store_direct: false, ..paths(0) };
        let (device, twin) = (on_device(&context, &weighed, &wanted), weighed.twin(&wanted));
        assert!(difference(&device, &twin) <= 1e-3 && device.emitted != even.twin(&wanted).emitted);
    }
}

#[test]
fn the_comparison_sees_another_seed() {
    let case = grey_box(0.0);
    let (a, b) = (case.twin(&paths(100)), case.twin(&Emission { seed: 7, ..paths(100) }));
    let moved = a.positions.iter().zip(&b.positions).filter(|(a, b)| a != b).count();
    assert!(moved > 90, "{moved}");
    assert!(std::panic::catch_unwind(|| difference(&a, &b)).is_err(), "unscattered photons must agree");
}

#[test]
fn any_number_of_lanes_walks_the_same_paths() {
    one_at_a_time();
    let case = Case::shipped("gi_ref");
    let emission = paths(5_003);
    let maps: Vec<_> = [1, 4, 8, 16].map(|lanes| on_device(&context(Some(lanes)), &case, &emission)).into();
    assert!(maps.iter().all(|map| difference(map, &maps[0]) <= 1e-3));
}

#[test]
fn a_million_paths_give_the_same_bytes_twice() {
    one_at_a_time();
    let context = context(None);
    let case = Case::shipped("gi_ref");
    let emission = Emission { store_direct: false, ..paths(1_000_003) };
    let (a, b) = (on_device(&context, &case, &emission), on_device(&context, &case, &emission));
    assert!(same(&a, &b) && a.len() > 2_000_000);
}

/// Memory of an older map, full of what no photon is.
fn used_memory(context: &Context, glossy: bool, photons: usize) -> PhotonMap {
    let positions = vec![PhotonPosition { position: [f32::NAN; 3] }; photons];
    let powers = vec![PhotonPower { power: [f32::NAN; 3] }; photons];
    let directions = vec![PhotonDirection { direction: [f32::NAN; 3] }; if glossy { photons } else { 0 }];
    PhotonMap::from_tables(context, &positions, &powers, &vec![f32::NAN; photons], &directions).unwrap()
}

#[test]
fn a_counted_map_has_the_same_bytes_twice_and_in_any_older_maps_memory() {
    one_at_a_time();
    // Of one lane: as on a GPU.
    let context = context(Some(1));
    for (name, amount) in [
        ("gi_ref", Amount::Paths(300_000)),
        ("gi_ref", Amount::Stored(200_000)),
        ("glossy", Amount::Paths(20_011)),
        ("glossy", Amount::Stored(20_000)),
    ] {
        let case = Case::shipped(name);
        let emission = Emission { amount, store_direct: false, ..paths(0) };
        let mut stage = compiled(&context, &case, &emission);
        let map = stage.emit(&emission, None).unwrap();
        let truth = read(&context, &map);
        let (stored, glossy) = (truth.len(), map.glossy());
        assert!(stored > 10_000 && glossy == (name == "glossy"));
        let again = read(&context, &stage.emit(&emission, None).unwrap());
        assert!(same(&truth, &again), "{name}, {amount:?}: another run, other bytes");

        // Into its own memory, from the next pass, and back.
        let next = Emission { pass: 1, ..emission };
        let other = stage.emit(&next, Some(map)).unwrap();
        assert!(!same(&truth, &read(&context, &other)), "another pass must show");
        let back = stage.emit(&emission, Some(other)).unwrap();
        assert!(same(&truth, &read(&context, &back)), "{name}, {amount:?}: after another pass");

        // Room for a part of it only, for a little less than it takes, for more; and with another number of tables.
        let hardly_too_few = stored - stored / 64 - 1024;
        for (photons, is_glossy) in [
            (0, glossy),
            (stored / 3, glossy),
            (hardly_too_few, glossy),
            (stored, glossy),
            (2 * stored, glossy),
            (stored / 3, !glossy),
            (2 * stored, !glossy),
        ] {
            let old = used_memory(&context, is_glossy, photons);
            let held = old.room();
            assert_eq!(held >= stored, photons >= stored, "memory for {held} photons, {stored} are stored");
            let map = stage.emit(&emission, Some(old)).unwrap();
            // Twice the room tells whose memory it is.
            assert_eq!(map.room() >= 2 * stored, photons == 2 * stored && is_glossy == glossy);
            let found = read(&context, &map);
            assert!(same(&truth, &found), "{name}, {amount:?}: into memory for {held} photons, glossy: {is_glossy}");
        }
    }
}

#[test]
fn one_byte_of_a_map_would_be_noticed() {
    let case = Case::shipped("glossy");
    let map = case.twin(&paths(1000));
    assert!(same(&map, &map.clone()) && !map.directions.is_empty());
    let changes: [fn(&mut PhotonTables); 5] = [
        |map| map.positions[7].position[2] = f32::from_bits(map.positions[7].position[2].to_bits() ^ 1),
        |map| map.powers[7].power[0] = -map.powers[7].power[0],
        |map| map.surfaces[7].side = -map.surfaces[7].side,
        |map| map.directions[7].direction[1] = f32::NAN,
        |map| map.emitted += 1,
    ];
    for (number, change) in changes.iter().enumerate() {
        let mut changed = map.clone();
        change(&mut changed);
        assert!(!same(&map, &changed), "change {number}");
    }
}

#[test]
fn stored_fills_the_same_slots_as_the_twin() {
    one_at_a_time();
    // Of one lane: as on a GPU.
    for context in [context(None), context(Some(1))] {
        for case in [grey_box(0.5), Case::shipped("gi_two_lights"), Case::shipped("sphere_and_plane")] {
            for wanted in [1, 17, 12_000] {
                let emission = Emission { amount: Amount::Stored(wanted), ..paths(0) };
                let (device, twin) = (on_device(&context, &case, &emission), case.twin(&emission));
                assert_eq!(device.len(), wanted as usize);
                assert_eq!(device.emitted, twin.emitted);
            }
        }
    }
}

#[test]
fn nothing_to_store_is_refused_as_the_twin_refuses_it() {
    one_at_a_time();
    let said = |result: Result<usize, Error>| {
        let error = result.expect_err("there is nothing to store");
        (error.to_string(), error.exit_code())
    };
    for context in [context(None), context(Some(1))] {
        for case in barren() {
            let emission = Emission { amount: Amount::Stored(5), store_direct: false, ..paths(0) };
            let twin = said(case.try_twin(&emission).map(|map| map.len()));
            let mut stage = compiled(&context, &case, &emission);
            assert_eq!(said(stage.emit(&emission, None).map(|map| map.stored)), twin);
            assert!(twin.0.contains("--stored 5: 0 photons") && twin.1 == 2, "{twin:?}");
        }
        // Where there is something the same call stores it.
        let emission = Emission { amount: Amount::Stored(5), store_direct: false, ..paths(0) };
        assert_eq!(on_device(&context, &grey_box(0.5), &emission).len(), 5);
    }
}

#[test]
fn a_scene_without_anything_gives_an_empty_map() {
    one_at_a_time();
    let context = context(None);
    let case = Case::parse("[[lights]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n");
    let map = on_device(&context, &case, &paths(10));
    assert_eq!((map.len(), map.emitted), (0, 10));
    assert_eq!(on_device(&context, &grey_box(0.5), &paths(0)).len(), 0);
}
