//! Open scenes: no path where nothing can be hit, and `--stored`.

use photile::cpu::gather::{PhotonMap, photon_radiance};
use photile::cpu::grid::{grid, grid_bounds};
use photile::cpu::photons::PhotonTables;
use photile::error::Result;
use photile::packing::Packed;
use photile::plan::cells::{self, CellSize, Form};
use photile::program::gathering::Gathering;
use photile::rays::camera::camera_direction;
use photile::rays::emission::{Amount, CELLS, Emission, EmissionPlan, entry};
use photile::rays::scene::SceneTables;
use photile::settings::{Pass, Settings};

use super::{Case, grey_box, paths};

#[test]
fn half_of_the_sphere_and_plane_would_be_wasted_and_the_mean_stays() {
    let with = Case::shipped("sphere_and_plane");
    let whole = Case { plan: EmissionPlan::whole_sphere(&with.packed).unwrap(), ..Case::shipped("sphere_and_plane") };
    let useful = with.plan.useful_share(&with.packed);
    // The plane takes the lower half of the directions; the sphere (12° across) lies in it but for a cell or two.
    assert!((0.5..0.52).contains(&useful), "{useful}");
    assert!((whole.plan.useful_share(&whole.packed) - 1.0).abs() < 1e-12);
    let number = 200_000;
    let first = |case: &Case| {
        let map = case.twin(&paths(number));
        let mut power = [0.0; 2];
        for (photon, surface) in map.powers.iter().zip(&map.surfaces).filter(|(_, s)| s.bounce == 0.0) {
            power[surface.shape as usize] += f64::from(photon.power[2]);
        }
        power
    };
    let (mapped, all) = (first(&with), first(&whole));
    // Exact: the plane's share is half of Φ less what the sphere takes, the sphere's its solid angle.
    let flux = 4.0 * std::f64::consts::PI * 6000.0;
    let cone = 0.5 * (1.0 - (1.0f64 - 4.0 / 300.0).sqrt());
    for (name, [sphere, plane], tolerance) in [("mapped", mapped, 2e-3), ("whole", all, 4e-3)] {
        // Low-discrepancy counts of a half and of 1/300 of 2·10⁵ paths; a wrong weight shows as a factor.
        assert!((sphere / (flux * cone) - 1.0).abs() < 10.0 * tolerance, "{name}: sphere {}", sphere / flux);
        assert!((plane / (flux * (0.5 - cone)) - 1.0).abs() < tolerance, "{name}: plane {}", plane / flux);
    }
}

#[test]
fn every_direction_that_hits_lies_in_a_kept_cell() {
    let case = Case::parse(
        "[materials.grey]\ncolor = [0.5, 0.5, 0.5]\n\
         [[lights]]\nposition = [1, 2, 3]\nintensity = [1, 1, 1]\n[[lights]]\nposition = [-4, 0, 1]\nintensity = [1, 2, 3]\n\
         [[planes]]\nnormal = [1, 2, 0.5]\noffset = -3\nmaterial = \"grey\"\n\
         [[spheres]]\ncenter = [5, 5, 5]\nradius = 0.1\nmaterial = \"grey\"\n\
         [[spheres]]\ncenter = [0, 9, 0]\nradius = 3\nmaterial = \"grey\"\n",
    );
    let whole = Case { plan: EmissionPlan::whole_sphere(&case.packed).unwrap(), ..case_of(&case) };
    let map = whole.twin(&paths(100_000));
    for (photon, surface) in map.positions.iter().zip(&map.surfaces).filter(|(_, s)| s.bounce == 0.0) {
        let p = glam::DVec3::from(photon.position.map(f64::from));
        // A first hit belongs to one of the lights: its cell is kept by that one.
        let kept = case.packed.lights.iter().enumerate().any(|(light, l)| {
            let d = (p - glam::DVec3::from(l.position.map(f64::from))).normalize();
            let row = ((1.0 - d.y) * 32.0).clamp(0.0, 63.0) as u32;
            let turn = (d.z.atan2(d.x) / std::f64::consts::TAU + 0.125).rem_euclid(1.0);
            let cell = row << 7 | (turn * 128.0).min(127.0) as u32;
            let [_, first, cells] = case.plan.counts[light];
            let own = &case.plan.cells[first as usize..(first + cells) as usize];
            own.binary_search(&entry(cell, 1, 0)).is_ok()
        });
        assert!(kept, "{p} on object {}", surface.shape);
    }
    let useful = case.plan.useful_share(&case.packed);
    assert!(useful < 0.62, "a half and two cones: {useful}");
}

fn case_of(case: &Case) -> Case {
    Case { packed: case.packed.clone(), features: case.features, plan: case.plan.clone() }
}

#[test]
fn more_paths_where_light_goes_on_store_more_and_keep_the_mean() {
    let even = Case::shipped("sphere_and_plane");
    let weighed = Case { plan: EmissionPlan::indirect(&even.packed).unwrap(), ..Case::shipped("sphere_and_plane") };
    // Straight from the light everything is known exactly: each object's direct flux, by weights of every size.
    let number = 400_000;
    let power = |case: &Case, bounce: f32, seed: u32| {
        let map = case.twin(&Emission { seed, ..paths(number) });
        let mut power = [0.0; 2];
        let mut stored = 0;
        for (photon, surface) in map.powers.iter().zip(&map.surfaces).filter(|(_, s)| s.bounce == bounce) {
            power[surface.shape as usize] += f64::from(photon.power[2]);
            stored += 1;
        }
        (power, stored)
    };
    let flux = 4.0 * std::f64::consts::PI * 6000.0;
    let cone = 0.5 * (1.0 - (1.0f64 - 4.0 / 300.0).sqrt());
    let ([sphere, plane], _) = power(&weighed, 0.0, 1);
    // As many paths as they are, a wrong weight shows as a factor.
    assert!((sphere / (flux * cone) - 1.0).abs() < 0.01, "sphere {}", sphere / (flux * cone));
    assert!((plane / (flux * (0.5 - cone)) - 1.0).abs() < 4e-3, "plane {}", plane / (flux * (0.5 - cone)));
    // Once scattered: the mean of some seeds, against ten times their standard error where paths are spread evenly.
    let seeds = 1..5;
    let mean = |case: &Case| {
        let all: Vec<_> = seeds.clone().map(|seed| power(case, 1.0, seed)).collect();
        let mean = |values: &dyn Fn(usize) -> f64| (0..all.len()).map(values).sum::<f64>() / all.len() as f64;
        ([mean(&|i| all[i].0[0]), mean(&|i| all[i].0[1])], mean(&|i| f64::from(all[i].1)))
    };
    let ((before, few), (after, many)) = (mean(&even), mean(&weighed));
    for shape in 0..2 {
        assert!((after[shape] / before[shape] - 1.0).abs() < 0.1, "{shape}: {} for {} W", after[shape], before[shape]);
    }
    eprintln!("stored after a bounce, of {number} paths: {few} evenly, {many} weighed");
    assert!(many > 2.0 * few, "{many} photons, {few} before");
}

#[test]
fn a_closed_scene_has_no_map() {
    assert!(EmissionPlan::indirect(&grey_box(0.5).packed).unwrap().cells.is_empty());
    assert!(grey_box(0.5).plan.cells.is_empty());
    assert!(Case::shipped("gi_ref").plan.cells.is_empty());
}

#[test]
fn stored_fills_exactly_and_no_path_too_many() {
    let case = grey_box(0.5);
    for wanted in [1, 2, 100, 70_000] {
        let map = case.twin(&Emission { amount: Amount::Stored(wanted), ..paths(0) });
        assert_eq!(
            (map.len(), map.powers.len(), map.surfaces.len()),
            (wanted as usize, wanted as usize, wanted as usize)
        );
        let one_less = case.twin(&paths(map.emitted - 1)).len();
        let enough = case.twin(&paths(map.emitted)).len();
        assert!(one_less < wanted as usize && wanted as usize <= enough, "{one_less} < {wanted} <= {enough}");
    }
}

/// A scene in which no path hits anything, and one in which each ends where the light itself arrives.
pub fn barren() -> [Case; 2] {
    let away = Case::parse("[[lights]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n");
    // A black sphere stores direct light only: none in hybrid.
    let black = Case::parse(
        "[materials.black]\ncolor = [0, 0, 0]\n[[lights]]\nposition = [0, 0, 0]\nintensity = [1, 1, 1]\n\
         [[spheres]]\ncenter = [3, 0, 0]\nradius = 1\nmaterial = \"black\"\n",
    );
    [away, black]
}

#[test]
fn nothing_to_hit_is_said() {
    for case in barren() {
        let emission = Emission { amount: Amount::Stored(5), store_direct: false, ..paths(0) };
        assert_eq!(case.twin(&Emission { amount: Amount::Paths(10), ..emission }).len(), 0);
        let error = case.try_twin(&emission).unwrap_err();
        assert!(error.to_string().contains("--stored 5: 0 photons"), "{error}");
        assert_eq!(error.exit_code(), 2);
    }
}

/// Of a picture of a shipped scene by gathered light alone: the mean radiance of each object, in blue.
fn seen_means(name: &str, case: &Case, map: &PhotonTables) -> [f64; 2] {
    let camera =
        photile::scene::load(format!("{}/scenes/{name}.toml", env!("CARGO_MANIFEST_DIR")).as_ref()).unwrap().camera;
    let settings = Settings { width: 32, height: 24, ..Settings::default() };
    let frame = case.packed.frame(&camera, &settings, &Pass::single(&settings));
    let scene = SceneTables::new(&case.packed, &case.features);
    let shapes = &case.packed.shapes;
    let bounds = grid_bounds(&map.view(), 2 * shapes.len());
    let plan = cells::plan(shapes, false, &bounds, map.len(), 1.5, CellSize::Auto, Form::Auto).unwrap();
    let gathering = Gathering { hashed: plan.hashed, ..Gathering::of(shapes, case.packed.sphere_count, false) };
    let tables = grid(&map.view(), &plan);
    let seen = PhotonMap { gathering: &gathering, plan: &plan, stored: map.view(), grid: &tables, tiles: None };
    let mut sums = [[0.0; 2]; 2];
    for (row, column) in (0..settings.height).flat_map(|row| (0..settings.width).map(move |column| (row, column))) {
        let direction = camera_direction(&frame, column as f32 + 0.5, row as f32 + 0.5);
        let origin = frame.position.into();
        let Some(hit) = scene.closest_hit(origin, direction, None) else { continue };
        let surface = scene.surface_at(origin, direction, hit);
        let [sum, pixels] = &mut sums[surface.shape];
        *sum += f64::from(photon_radiance(&scene, &seen, &surface, -direction, 0).z);
        *pixels += 1.0;
    }
    sums.map(|[sum, pixels]| sum / pixels)
}

#[test]
fn pictures_keep_their_mean_whatever_the_map_of_directions() {
    let name = "sphere_and_plane";
    let with = |plan: fn(&Packed) -> Result<EmissionPlan>| {
        let case = Case::shipped(name);
        Case { plan: plan(&case.packed).unwrap(), ..case }
    };
    // Paths of a cell that is divided worth as much as those of a whole one, all of them together what they should be.
    let unweighed = |packed: &Packed| {
        let mut plan = EmissionPlan::indirect(packed)?;
        plan.cells.iter_mut().for_each(|of_a_part| *of_a_part = entry(*of_a_part & (CELLS as u32 - 1), 1, 0));
        Ok(plan)
    };
    const SEEDS: u32 = 16;
    // Mean over seeds, and its own variance.
    let means = |case: &Case, store_direct: bool, number: u32| {
        let all: Vec<[f64; 2]> = (1..=SEEDS)
            .map(|seed| seen_means(name, case, &case.twin(&Emission { seed, store_direct, ..paths(number) })))
            .collect();
        [0, 1].map(|shape| {
            let mean = all.iter().map(|means| means[shape]).sum::<f64>() / f64::from(SEEDS);
            let squares = all.iter().map(|means| (means[shape] - mean).powi(2)).sum::<f64>();
            (mean, squares / f64::from(SEEDS * (SEEDS - 1)))
        })
    };
    for (store_direct, number, kept) in [
        (true, 50_000, vec![with(EmissionPlan::new)]),
        (false, 200_000, vec![with(EmissionPlan::new), with(EmissionPlan::indirect)]),
    ] {
        let truth = means(&with(EmissionPlan::whole_sphere), store_direct, number);
        // Objects whose mean is another by more than four standard errors.
        let others = |found: [(f64, f64); 2]| {
            (0..2).filter(|i| (found[*i].0 - truth[*i].0).abs() > 4.0 * (found[*i].1 + truth[*i].1).sqrt()).count()
        };
        for case in kept {
            let found = means(&case, store_direct, number);
            assert_eq!(others(found), 0, "stored from the light: {store_direct}; {found:?} for {truth:?}");
            // As bright as if the paths left out had been given their share of the power.
            let useful = case.plan.useful_share(&case.packed);
            assert_eq!(others(found.map(|(mean, variance)| (mean / useful, variance / useful.powi(2)))), 2);
        }
        let wrong = means(&with(unweighed), store_direct, number);
        assert!(others(wrong) > 0, "forgotten weights must show: {wrong:?} for {truth:?}");
    }
}
