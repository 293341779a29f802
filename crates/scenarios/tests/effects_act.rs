//! Effects of a scenario act on its bundle, at the size that they state.

mod common;

use common::{SLEWS, scenario};
use focal_plane::{ARCSEC_PER_RAD, AttitudeSource, rotation_vector};
use nalgebra::Vector3;
use scenarios::{ScenarioError, simulate_with_truth};
use star_tracker::{Measured, NoiseStreams, Rows, Scratch};

/// A rolling shutter shifts a star at row y by its velocity times `line_time` x y. To second order
/// remain acceleration (0.6 px/s^2 x (16 ms)^2 / 2 = 7e-5 px) and the shift of the row itself
/// (v `line_time` relative: 7 px/s x 30e-6 of 0.1 px = 2e-5 px).
#[test]
fn a_rolling_shutter_shifts_by_velocity_times_row() {
    let rest = format!(
        "{SLEWS}[[effect]]\nid = \"rolling_shutter\"\nline_time_s = 30e-6\n\
         [run]\nduration_s = 140.0\nrate_hz = 2.0"
    );
    let simulated = simulate_with_truth(&scenario("", &rest).unwrap(), 0).unwrap();
    let [x, y, z] = &simulated.direction;
    let t_s = simulated.rows.t_of_rows_s();
    let mut largest = 0.0_f64;
    for row in 0..t_s.len() {
        let u = Vector3::new(x[row], y[row], z[row]);
        let camera = simulated.pbm.camera();
        let at = |t: f64| {
            camera
                .project(&(simulated.truth.attitude(t).unwrap() * u))
                .unwrap()
        };
        let (here, before, after) = (at(t_s[row]), at(t_s[row] - 1e-3), at(t_s[row] + 1e-3));
        let delay = 30e-6 * here.y;
        let dx = simulated.measured.x_px[row] - here.x - delay * (after.x - before.x) / 2e-3;
        let dy = simulated.measured.y_px[row] - here.y - delay * (after.y - before.y) / 2e-3;
        assert!(dx.abs().max(dy.abs()) < 2e-4, "row {row}: {dx} {dy}");
        largest = largest.max((simulated.measured.x_px[row] - here.x).abs());
    }
    assert!(largest > 0.05, "the shutter shows: {largest} px");
}

/// A misalignment that follows a channel: without noise the measured attitude differs from the truth
/// by coefficient x (channel - its mean), with the channel linear between its samples.
#[test]
fn a_misalignment_follows_its_channel() {
    let rest = format!(
        "{SLEWS}[[effect]]\nid = \"thermal_misalignment\"\nchannel = \"bracket_c\"\n\
         x_arcsec_per_unit = 3.0\ny_arcsec_per_unit = -2.0\nz_arcsec_per_unit = 0.0\n\
         [housekeeping]\nrate_hz = 0.2\nchannel = [{{ kind = \"sinusoid\", name = \"bracket_c\", \
         mean = 20.0, amplitude = 1.5, period_s = 70.0 }}]\n\
         [run]\nduration_s = 140.0\nrate_hz = 2.0"
    );
    let simulated = simulate_with_truth(&scenario("", &rest).unwrap(), 0).unwrap();
    let channel = simulated
        .bundle
        .housekeeping
        .as_ref()
        .unwrap()
        .series("bracket_c")
        .unwrap();
    let attitude = simulated.bundle.attitude.as_ref().unwrap();
    let mut largest = 0.0_f64;
    for (&t, q) in attitude.t_s.iter().zip(&attitude.q) {
        let theta = rotation_vector(q, &simulated.truth.attitude(t).unwrap()) * ARCSEC_PER_RAD;
        let drive = channel.at(t).unwrap() - channel.mean();
        // 1e-6 arcsec = 5e-12 rad: rounding of pixels at 1e-13 px, roll seven times worse
        assert!(
            (theta - Vector3::new(3.0, -2.0, 0.0) * drive).norm() < 1e-6,
            "{theta:?} at {t} s"
        );
        largest = largest.max(drive.abs());
    }
    assert!(largest > 1.0, "the channel moves: {largest}");
}

/// The bundle's catalogue is the truth: with no noise and no effect, catalogue directions at the epoch
/// projected at the reference attitude are the measured positions.
#[test]
fn without_errors_the_tables_agree_with_each_other() {
    let rest = format!(
        "{SLEWS}[reference]\n[rates]\n[run]\nduration_s = 140.0\nrate_hz = 2.0\nepoch = \"2020-08-17T00:00:00\""
    );
    let simulated = simulate_with_truth(&scenario("", &rest).unwrap(), 0).unwrap();
    let bundle = &simulated.bundle;
    let (stars, catalogue) = (
        bundle.stars.as_ref().unwrap(),
        bundle.catalog.as_ref().unwrap(),
    );
    let reference = bundle.reference.as_ref().unwrap().series().unwrap();
    let year = bundle.meta.julian_year(0.0).unwrap();
    assert!(year > 2020.6 && year < 2020.7);
    stars.check().unwrap();
    assert!((catalogue.epoch_year() - 2000.0).abs() < 1e-12);
    let t_s = stars.t_of_rows_s();
    for row in 0..stars.rows() {
        let index = catalogue.index_of(stars.star_id[row]).unwrap();
        let v = reference.attitude(t_s[row]).unwrap() * catalogue.direction_at(index, year);
        let at = simulated.pbm.camera().project(&v).unwrap();
        // rounding of directions (1e-16 x 2904 px) and of positions up to 512 px
        assert!((at.x - stars.x_px[row]).hypot(at.y - stars.y_px[row]) < 1e-9);
    }
    let rates = bundle.rates.as_ref().unwrap();
    for (&t, w) in rates.t_s.iter().zip(&rates.w) {
        assert!((simulated.truth.rate_rad_s(t).unwrap() - w).norm() < 1e-15);
    }
}

/// The undisturbed model of a simulated tracker is the declared one.
#[test]
fn the_model_without_effects_has_none() {
    let rest = format!(
        "{SLEWS}[[effect]]\nid = \"rolling_shutter\"\nline_time_s = 30e-6\n[run]\nduration_s = 5.0\nrate_hz = 2.0"
    );
    let given = scenario("temporal_arcsec = 1.0", &rest).unwrap();
    assert!(given.model_without_effects().effects.is_empty());
    let simulated = simulate_with_truth(&given, 0).unwrap();
    let [x, y, z] = &simulated.direction;
    let rows = Rows {
        t_s: &simulated.rows.t_s,
        first_row: &simulated.rows.first_row,
        slot: &[],
        star_id: &[],
        mag: &[],
        bv: &[],
        direction: focal_plane::Vectors { x, y, z },
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
    // the same noise, so the difference is the effect alone
    let noise = |m: &Measured, row: usize| m.x_px[row] - m.noise_free_x_px[row];
    for row in 0..plain.x_px.len() {
        assert!((noise(&plain, row) - noise(&simulated.measured, row)).abs() < 1e-12);
    }
}

#[test]
fn an_effect_that_does_not_exist_is_named() {
    let rest = format!(
        "{SLEWS}[[effect]]\nid = \"roling_shutter\"\n[run]\nduration_s = 5.0\nrate_hz = 2.0"
    );
    let message = scenario("", &rest)
        .and_then(|scenario| simulate_with_truth(&scenario, 0))
        .unwrap_err()
        .to_string();
    assert!(message.contains("rolling_shutter"), "{message}");
}

#[test]
fn a_scenario_without_a_camera_or_a_rate_says_what_it_needs() {
    let given = scenario("", &format!("{SLEWS}[run]\nduration_s = 5.0")).unwrap();
    let name = "run.rate_hz or tracker.update_rate_hz";
    assert_eq!(
        simulate_with_truth(&given, 0).unwrap_err(),
        ScenarioError::Missing { name }
    );
    let mut given = scenario(
        "",
        &format!("{SLEWS}[run]\nduration_s = 5.0\nrate_hz = 1.0"),
    )
    .unwrap();
    given.model.tracker.pixels = None;
    let name = "tracker.pixels";
    assert_eq!(
        simulate_with_truth(&given, 0).unwrap_err(),
        ScenarioError::Missing { name }
    );
}
