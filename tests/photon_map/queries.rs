//! No query misses a photon or counts one twice, whatever collides.

use glam::Vec3;
use photile::cpu::gather::{PhotonMap, near};
use photile::cpu::grid::{GridTables, cells_of, face_of, grid, hashed_row};
use photile::plan::cells::{CellSize, Form, GridPlan};
use photile::program::gathering::Gathering;
use photile::records::PhotonPosition;

use super::{Map, Random, room, room_photons, surface_point};

/// Photons of a face within R of a point: by the definition, sorted by number.
fn truth(map: &Map, face: usize, point: Vec3, radius: f32) -> Vec<u32> {
    let inverse = 1.0 / radius;
    (0..map.len() as u32)
        .filter(|i| {
            let away = Vec3::from(map.positions[*i as usize].position) - point;
            face_of(&map.surfaces[*i as usize]) == face && away.dot(away) * (inverse * inverse) < 1.0
        })
        .collect()
}

/// The grid's answer, in the numbers from before the sort.
fn answer(map: &PhotonMap, tables: &GridTables, face: usize, point: Vec3) -> Vec<u32> {
    let mut found: Vec<u32> = near(map, face, point, 0).iter().map(|n| tables.order[n.photon]).collect();
    found.sort_unstable();
    found
}

/// How many of the photons around a point lie in buckets that its own row looks into as well: of another row, they would
/// be counted twice if rows did not tell their photons.
fn shared(map: &Map, plan: &GridPlan, face: usize, point: Vec3, around: &[u32]) -> usize {
    let record = &plan.faces[face];
    let cell = |position: Vec3| cells_of(&PhotonPosition { position: position.into() }, record, &plan.gather);
    let bucket = |[u, v, w]: [i32; 3]| hashed_row(record, v, w).wrapping_add(u) & plan.gather.bucket_mask as i32;
    let [_, v, w] = cell(point);
    let along = if record.flipped != 0.0 { Vec3::Y } else { Vec3::X } * plan.gather.radius;
    let looked_into: Vec<i32> = (cell(point - along)[0]..=cell(point + along)[0]).map(|u| bucket([u, v, w])).collect();
    let is_shared = |photon: &&u32| {
        let own = cell(map.positions[**photon as usize].position.into());
        own[1..] != [v, w] && looked_into.contains(&bucket(own))
    };
    around.iter().filter(is_shared).count()
}

/// Queries on and off the surfaces, and exactly on cells' borders; returns how many photons were found in all, and how
/// many of them only their rows kept from being found twice.
fn check(map: &Map, radius: f32, size: CellSize, form: Form, queries: usize) -> [usize; 2] {
    let shapes = room();
    let plan = map.plan(&shapes, radius, size, form);
    let tables = grid(&map.tables(), &plan);
    let gathering = Gathering { hashed: plan.hashed, ..Gathering::default() };
    let seen = PhotonMap { gathering: &gathering, plan: &plan, stored: map.tables(), grid: &tables, tiles: None };
    let mut random = Random::new(99);
    let mut found = [0; 2];
    for number in 0..queries {
        let shape = random.below(shapes.len());
        let mut p = surface_point(&shapes[shape], &mut random);
        if number % 3 == 0 {
            let axis = random.below(3);
            let cell = plan.gather.cell[axis];
            p[axis] = (p[axis] / cell).round() * cell;
        }
        let face = 2 * shape + usize::from(number % 5 == 0);
        let (expected, answered) = (truth(map, face, p.into(), radius), answer(&seen, &tables, face, p.into()));
        assert_eq!(answered, expected, "query {number} at {p:?} on face {face}, R = {radius}, {form:?}, {size:?}");
        found[0] += expected.len();
        if plan.hashed {
            found[1] += shared(map, &plan, face, p.into(), &expected);
        }
    }
    found
}

#[test]
fn a_million_queries_with_forced_collisions_miss_nothing_and_double_nothing() {
    let map = room_photons(400, 1);
    let mut all = 0;
    // As few buckets as faces may share, for thousands of cells: every row shares its buckets with many others.
    for (buckets, radius) in [(2, 0.3), (2, 0.7), (1024, 0.1), (4096, 1.5)] {
        let [found, shared] = check(&map, radius, CellSize::Auto, Form::Hashed(Some(buckets)), 250_000);
        all += found;
        // Wide cells are so few that their rows share none, whatever the hash.
        let forces = radius < 1.0;
        assert!(!forces || shared > 20, "R = {radius}: only {shared} photons lie in two buckets of a query");
    }
    // Faces whose u and v are exchanged read other numbers off the same photon: many near by, in few buckets.
    let close = room_photons(3000, 14);
    let [found, forced] = check(&close, 0.8, CellSize::Auto, Form::Hashed(Some(2)), 5000);
    all += found;
    assert!(all > 300_000, "only {all} photons in reach: the queries tested nothing");
    // A bucket for each cell, nearly.
    let [same, unforced] = check(&close, 0.8, CellSize::Auto, Form::Hashed(Some(1 << 22)), 5000);
    assert_eq!(same, found);
    assert!(
        forced > 20 && unforced < forced / 10,
        "{forced} photons in two buckets of a query, {unforced} in many buckets"
    );
}

#[test]
fn faces_whose_rows_began_at_the_same_bucket_would_be_mixed_up() {
    let (map, radius) = (room_photons(400, 1), 0.7);
    let mut plan = map.plan(&room(), radius, CellSize::Auto, Form::Hashed(Some(2)));
    let mixed = |plan: &GridPlan| {
        let tables = grid(&map.tables(), plan);
        let gathering = Gathering { hashed: true, ..Gathering::default() };
        let seen = PhotonMap { gathering: &gathering, plan, stored: map.tables(), grid: &tables, tiles: None };
        let wrong = |photon: &usize| {
            let (face, point) = (face_of(&map.surfaces[*photon]), Vec3::from(map.positions[*photon].position));
            answer(&seen, &tables, face, point) != truth(&map, face, point, radius)
        };
        (0..map.len()).filter(wrong).count()
    };
    assert_eq!(mixed(&plan), 0);
    plan.faces.iter_mut().for_each(|face| face.base = 0.0);
    assert!(mixed(&plan) > 10);
}

#[test]
fn dense_and_hashed_grids_find_the_same_at_every_cell_size() {
    let map = room_photons(1000, 2);
    for form in [Form::Dense, Form::Hashed(None)] {
        for ratio in [0.2, 0.5, 1.0, 2.7] {
            check(&map, 0.5, CellSize::Metres([0.5 * ratio; 3]), form, 2000);
        }
        check(&map, 0.5, CellSize::Metres([0.1, 0.5, 2.0]), form, 2000);
        check(&map, 0.5, CellSize::Counts([60, 40, 40]), form, 2000);
    }
}

#[test]
fn a_map_far_from_the_origin_and_photons_on_borders_are_found() {
    let mut map = room_photons(500, 3);
    let mut random = Random::new(4);
    // Photons exactly on cells' corners, in negative and positive coordinates, and kilometres out on the floor.
    for i in -40..40 {
        map.push([i as f32 * 0.25, -2.0, i as f32 * -0.25], 4, 1.0, &mut random);
        map.push([i as f32 * 1000.0, -2.0, 0.0], 4, 1.0, &mut random);
    }
    check(&map, 0.5, CellSize::Auto, Form::Auto, 20_000);
}

#[test]
fn photons_beyond_the_last_cell_number_are_found_by_their_neighbours() {
    let (mut map, mut random) = (room_photons(500, 5), Random::new(6));
    // Cells of 0.25 m have numbers up to two million metres out. A few photons stay near enough to each other there,
    // where floats are 0.25 m apart.
    for i in 0..400 {
        let far =
            |random: &mut Random| [-2.6e6, -1.9e6, 0.0, 1.9e6, 2.6e6][random.below(5)] + random.below(8) as f32 * 0.25;
        let position = [far(&mut random), -2.0, far(&mut random)];
        map.push(position, 4, if i % 7 == 0 { -1.0 } else { 1.0 }, &mut random);
    }
    let plan = map.plan(&room(), 0.5, CellSize::Auto, Form::Auto);
    assert!(plan.hashed && plan.gather.cell == [0.25; 3]);
    let tables = grid(&map.tables(), &plan);
    let gathering = Gathering { hashed: true, ..Gathering::default() };
    let seen = PhotonMap { gathering: &gathering, plan: &plan, stored: map.tables(), grid: &tables, tiles: None };
    let mut found = 0;
    for photon in 500..map.len() {
        let (face, point) = (face_of(&map.surfaces[photon]), Vec3::from(map.positions[photon].position));
        let expected = truth(&map, face, point, 0.5);
        assert_eq!(answer(&seen, &tables, face, point), expected, "around {point}");
        found += expected.len();
    }
    assert!(found > 800, "only {found}: hardly more than themselves");
}

#[test]
fn a_lost_photon_would_be_noticed() {
    let map = room_photons(300, 1);
    let plan = map.plan(&room(), 0.7, CellSize::Auto, Form::Dense);
    let tables = grid(&map.tables(), &plan);
    let gathering = Gathering::default();
    let seen = PhotonMap { gathering: &gathering, plan: &plan, stored: map.tables(), grid: &tables, tiles: None };
    let photon = 17;
    let (face, point) = (face_of(&map.surfaces[photon]), Vec3::from(map.positions[photon].position));
    let mut fewer = map.clone();
    fewer.surfaces[photon].side *= -1.0;
    assert_eq!(answer(&seen, &tables, face, point), truth(&map, face, point, 0.7));
    assert_ne!(answer(&seen, &tables, face, point), truth(&fewer, face, point, 0.7));
}
