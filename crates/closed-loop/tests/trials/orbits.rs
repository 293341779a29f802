//! Aberration by an orbit that no channel tells: five unknowns, and a reference for each of its rivals.

use closed_loop::Closed;
use scenarios::simulate;
use telemetry::report::Report;

use crate::kit::{Case, Path, closed, named, reported};

/// 1000 m/s are 0.69 arcsec; twelve stars of 7.4 arcsec in 5600 frames know an axis to 0.03 arcsec, and an amplitude of
/// either phase to 0.04: sixteen sigma and more over a turn, half of it where a part looks like a constant.
fn of_an_orbit(path: Path, seed: u64, period_s: f64) -> Closed {
    let mut case = Case::new(path, seed);
    case.duration_s = 2800.0;
    case.stars = 12;
    let orbit = format!(
        "speed_m_s = 1000.0\nperiod_s = {period_s:?}\nphase_rad = 0.7\nnode_deg = 40.0\ninclination_deg = 55.0"
    );
    case.with("velocity_aberration", &orbit).close()
}

/// Named alone, whatever the motion and however much of the orbit is seen; the speed and the period are what they
/// were.
#[test]
fn an_orbit_that_no_channel_tells_is_found() {
    for (path, period_s) in [
        (Path::Drift, 3000.0),
        (Path::Slews, 3600.0),
        (Path::Still, 2600.0),
    ] {
        let report = of_an_orbit(path, 40, period_s).report;
        assert_eq!(named(&report), ["velocity_aberration"], "{path:?}");
        let told = &report.effects[0].parameters;
        for (name, truth) in [("speed_m_s", 1000.0), ("period_s", period_s)] {
            let sigma = told[name].sigma.expect("it has an error");
            let off = (told[name].value - truth) / sigma;
            assert!(off.abs() < 4.0, "{path:?}: {name} {:?}", told[name]);
            assert!(sigma < 0.5 * truth, "{path:?}: {name} {:?}", told[name]);
        }
        assert!(!report.unattributed.present, "{path:?}");
    }
}

/// Beside a line of its period an orbit of several turns leaves a white reference, and is still what is named: it has
/// two unknowns less.
#[test]
fn an_orbit_is_held_against_the_line_in_its_place() {
    let mut case = Case::new(Path::Still, 41);
    case.duration_s = 6600.0;
    case.stars = 5;
    let orbit = "speed_m_s = 400.0\nperiod_s = 3000.0\nphase_rad = 0.7\nnode_deg = 40.0\ninclination_deg = 55.0";
    let report = case.with("velocity_aberration", orbit).close().report;
    assert_eq!(named(&report), ["velocity_aberration"]);
    assert!(!report.unattributed.present);
}

/// A tracker without a reference, for twenty-seven minutes.
fn alone(path: Path, seed: u64) -> Case {
    let mut case = Case::new(path, seed).reference("none");
    case.duration_s = 1600.0;
    case
}

/// Noise of a centroid, circular, arcsec.
const QUIET: f64 = 0.7;

/// 7.6 km/s are a scale of 25 ppm along the boresight, 0.5 arcsec 6 deg off it: 3200 frames of twelve stars of 0.5 arcsec
/// tell a scale to 0.13 ppm, and in 28 % of a turn the three numbers of a sine to a few per cent of it.
#[test]
fn an_orbit_stretches_what_frames_see_that_turn_freely() {
    for (path, seed) in [(Path::Nods, 3), (Path::Drift, 5)] {
        let orbit = "speed_m_s = 7600.0\nperiod_s = 5700.0\nphase_rad = 2.6\nnode_deg = 138.0\ninclination_deg = 51.0";
        let case = alone(path, seed).with("velocity_aberration", orbit);
        let report = reported(&case.quiet(QUIET));
        assert_eq!(named(&report), ["velocity_aberration"], "{path:?}");
        assert!(!report.unattributed.present, "{path:?}");
        let told = &report.effects[0].parameters;
        for (name, truth, most) in [("period_s", 5700.0, 800.0), ("speed_m_s", 7600.0, 2000.0)] {
            let sigma = told[name].sigma.expect("it has an error");
            let off = (told[name].value - truth) / sigma;
            assert!(
                off.abs() < 4.0 && sigma < most,
                "{path:?}: {name} {:?}",
                told[name]
            );
        }
    }
}

/// What stretches frames by 30 ppm and `shape`, from 0 at the start to 1 at the end.
fn stretched(seed: u64, shape: fn(f64) -> f64) -> Report {
    let scenario = alone(Path::Nods, seed).quiet(QUIET);
    let mut bundle = simulate(&scenario).expect("a bundle");
    let stars = bundle.stars.as_mut().expect("it has some");
    for frame in 0..stars.frames() {
        let share = frame as f64 / stars.frames() as f64;
        let scale = 1.0 + 3e-5 * shape(share);
        for row in stars.rows_of(frame) {
            stars.x_px[row] *= scale;
            stars.y_px[row] *= scale;
        }
    }
    let closed = closed(&scenario.model_without_effects(), &bundle);
    closed.expect("the loop closes").report
}

/// A focal length that follows a wave of twenty minutes, or settles, goes round no planet.
#[test]
fn a_focal_length_that_goes_its_own_way_is_no_orbit() {
    let wave = |share: f64| (core::f64::consts::TAU * 1.3 * share).sin();
    let settles = |share: f64| (6.0 * (share - 0.45)).tanh();
    for (seed, shape) in [(3, wave as fn(f64) -> f64), (8, settles)] {
        let report = stretched(seed, shape);
        let orbit = named(&report).contains(&"velocity_aberration");
        assert!(!orbit, "{seed}: {:?}", report.effects);
        assert!(report.unattributed.present, "{seed}");
    }
}
