//! The device against its twin, and against itself.

use std::rc::Rc;
use std::sync::{Mutex, MutexGuard, PoisonError};

use photile::cl::{Buffer, Context, devices};
use photile::cpu::grid::{PhotonSurface, face_of};
use photile::cpu::photons::PhotonTables;
use photile::cpu::scan::exclusive_scan;
use photile::emission::{Amount, Emission, Sampler};
use photile::stage::photons::Photons;
use photile::stage::scan::Scan;

use crate::{Case, grey_box, paths};

/// PoCL 3.1 crashes now and then when several threads build programs at once: one test at a time has the device.
fn alone() -> MutexGuard<'static, ()> {
    static DEVICE: Mutex<()> = Mutex::new(());
    DEVICE.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The first device, with its own number of lanes or another.
fn context(lanes: Option<u32>) -> Rc<Context> {
    let mut device = devices(None).unwrap().remove(0);
    device.lanes = lanes.unwrap_or(device.lanes);
    Rc::new(Context::new(device).unwrap())
}

fn on_device(context: &Rc<Context>, case: &Case, emission: &Emission) -> PhotonTables {
    let mut stage = Photons::new(Rc::clone(context), Rc::new(Scan::new(context).unwrap()));
    stage.upload(&case.packed, case.plan.clone()).unwrap();
    stage.compile(&case.features, emission).unwrap();
    let map = stage.emit(emission, None).unwrap();
    let take = |all: Vec<_>| all[..map.stored].to_vec();
    PhotonTables {
        positions: take(map.positions.to_vec(context).unwrap()),
        powers: map.powers.to_vec(context).unwrap()[..map.stored].to_vec(),
        surfaces: map.faces.to_vec(context).unwrap()[..map.stored].iter().map(surface_of).collect(),
        directions: map.directions.map_or(Vec::new(), |d| d.to_vec(context).unwrap()[..map.stored].to_vec()),
        emitted: map.emitted,
    }
}

/// What a face says of a surface.
fn surface_of(face: &f32) -> PhotonSurface {
    let side = if face % 2.0 == 0.0 { 1.0 } else { -1.0 };
    PhotonSurface { object: (face / 2.0).floor(), side, bounce: f32::NAN }
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
    let _alone = alone();
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
    let _alone = alone();
    let context = context(None);
    for (name, store_direct, sampler) in [
        ("gi_ref", true, Sampler::Sequence),
        ("gi_two_lights", false, Sampler::Sequence),
        ("sphere_and_plane", true, Sampler::Sequence),
        ("glossy", true, Sampler::Random),
    ] {
        let case = Case::shipped(name);
        for number in [1, 15, 16, 17, 20_011] {
            let emission = Emission { store_direct, sampler, ..paths(number) };
            let (device, twin) = (on_device(&context, &case, &emission), case.twin(&emission));
            let elsewhere = difference(&device, &twin);
            // See `difference`; bit for bit on PoCL, a few in ten thousand on GPUs.
            assert!(elsewhere <= 1e-3, "{name}, {number} paths: {elsewhere} of the photons lie elsewhere");
        }
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
    let _alone = alone();
    let case = Case::shipped("gi_ref");
    let emission = paths(5_003);
    let maps: Vec<_> = [1, 4, 8, 16].map(|lanes| on_device(&context(Some(lanes)), &case, &emission)).into();
    assert!(maps.iter().all(|map| difference(map, &maps[0]) <= 1e-3));
}

#[test]
fn a_million_paths_give_the_same_bytes_twice() {
    let _alone = alone();
    let context = context(None);
    let case = Case::shipped("gi_ref");
    let emission = Emission { store_direct: false, ..paths(1_000_003) };
    let (a, b) = (on_device(&context, &case, &emission), on_device(&context, &case, &emission));
    assert!(a.positions == b.positions && a.powers == b.powers && a.len() > 2_000_000);
    assert!(a.surfaces.iter().map(face_of).eq(b.surfaces.iter().map(face_of)));
}

#[test]
fn stored_fills_the_same_slots_as_the_twin() {
    let _alone = alone();
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
fn a_scene_without_anything_gives_an_empty_map() {
    let _alone = alone();
    let context = context(None);
    let case = Case::parse("[[lights]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n");
    let map = on_device(&context, &case, &paths(10));
    assert_eq!((map.len(), map.emitted), (0, 10));
    assert_eq!(on_device(&context, &grey_box(0.5), &paths(0)).len(), 0);
}
