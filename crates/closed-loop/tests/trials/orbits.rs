//! Aberration by an orbit that no channel tells: five unknowns, and a reference for each of its rivals.

use closed_loop::Closed;

use crate::kit::{Case, Path};

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
        let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids, ["velocity_aberration"], "{path:?}");
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
    let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!(ids, ["velocity_aberration"]);
    assert!(!report.unattributed.present);
}
