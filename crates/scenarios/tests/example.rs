//! The example in `fixtures/example`: what the scenario makes, small, and clear enough to find.

use std::path::{Path, PathBuf};

use focal_plane::Vectors;
use scenarios::{Scenario, simulate_with_truth};
use star_tracker::{Measured, NoiseStreams, Rows, Scratch};
use telemetry::{Bundle, Model};

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures")
}

/// The fixture holds the scenario's bundle. Positions are rounded to 1e-4 px; another libm may round
/// one the other way.
#[test]
fn the_fixture_is_what_the_scenario_makes() {
    let scenario = Scenario::read(&fixtures().join("scenarios/example.toml")).unwrap();
    let made = scenarios::simulate(&scenario).unwrap();
    let kept = Bundle::read(&fixtures().join("example/bundle")).unwrap();
    let (made_stars, kept_stars) = (made.stars.unwrap(), kept.stars.unwrap());
    assert_eq!(made_stars.star_id, kept_stars.star_id);
    assert_eq!(made_stars.t_s, kept_stars.t_s);
    for (a, b) in made_stars.x_px.iter().zip(&kept_stars.x_px) {
        assert!((a - b).abs() < 1.5e-4);
    }
    assert_eq!(made.meta, kept.meta);
    let size: u64 = std::fs::read_dir(fixtures().join("example/bundle"))
        .unwrap()
        .map(|entry| entry.unwrap().metadata().unwrap().len())
        .sum();
    assert!(size < 500_000, "{size} bytes");
    let model = Model::read(&fixtures().join("example/model.toml")).unwrap();
    assert_eq!(
        model,
        Model {
            file: model.file.clone(),
            ..scenario.model_without_effects()
        }
    );
    assert!(model.effects.is_empty());
}

/// How clearly the shutter shows: root of the sum over rows of (shift / sigma)^2, with the temporal
/// noise alone and before anything is fitted, between 15 and 30.
#[test]
fn the_shutter_shows_clearly_but_not_absurdly() {
    let scenario = Scenario::read(&fixtures().join("scenarios/example.toml")).unwrap();
    let simulated = simulate_with_truth(&scenario, 0).unwrap();
    let [x, y, z] = &simulated.direction;
    let rows = Rows {
        t_s: &simulated.rows.t_s,
        first_row: &simulated.rows.first_row,
        slot: &simulated.rows.slot,
        star_id: &simulated.rows.star_id,
        mag: &[],
        bv: &[],
        direction: Vectors { x, y, z },
    };
    let mut plain = Measured::default();
    let (mut streams, mut scratch) = (NoiseStreams::new(1, 0), Scratch::default());
    let pbm = simulated.pbm.undisturbed();
    pbm.measure_into(
        &simulated.truth,
        rows,
        &mut streams,
        &mut scratch,
        &mut plain,
    );
    let sigma_px = 7.43 / 2_f64.sqrt() / pbm.camera().arcsec_per_px()[0];
    let mut sum = 0.0;
    for row in 0..plain.x_px.len() {
        let dx = simulated.measured.noise_free_x_px[row] - plain.noise_free_x_px[row];
        let dy = simulated.measured.noise_free_y_px[row] - plain.noise_free_y_px[row];
        sum += (dx * dx + dy * dy) / (sigma_px * sigma_px);
    }
    let significance = f64::sqrt(sum);
    assert!((15.0..30.0).contains(&significance), "{significance} sigma");
}
