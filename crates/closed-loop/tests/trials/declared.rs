//! The loop closed again, with the model that it wrote.

use telemetry::report::Errors;

use crate::kit::{Case, Path, VELOCITY, closed, power};

/// What was found and declared is taken off before anything is looked for: nothing is found again, of stars or of
/// attitudes, and the errors before are those that were left, but for the few parameters that another fold gives
/// otherwise (p of them by p/n of a variance, here below 1 %).
#[test]
fn what_is_declared_is_not_found_again() {
    let orbit = "speed_m_s = 7600.0\nperiod_s = 900.0\nphase_rad = 0.7\nnode_deg = 40.0\ninclination_deg = 55.0";
    let found = [
        (Path::Turns, "time_tag_offset", "offset_s = 0.03"),
        (Path::Turns, "exposure_smear", "exposure_s = 1.6"),
        (Path::Drift, "velocity_aberration", orbit),
        (Path::Scan, "velocity_aberration", "scale = 1.0"),
        (
            Path::Drift,
            "thermal_misalignment",
            "channel = \"bracket_c\"\nx_arcsec_per_unit = 3.0\ny_arcsec_per_unit = -2.0",
        ),
    ];
    for (path, id, parameters) in found {
        let mut case = Case::new(path, 7).with(id, parameters);
        case.duration_s = if path == Path::Drift { 900.0 } else { 600.0 };
        if parameters == "scale = 1.0" {
            case.channels += VELOCITY;
        }
        let (model, mut bundle) = case.make();
        for level in ["stars", "attitudes"] {
            if level == "attitudes" {
                bundle.stars = None;
            }
            let first = closed(&model, &bundle).expect("the loop closes");
            let ids: Vec<&str> = first.report.effects.iter().map(|e| e.id.as_str()).collect();
            assert_eq!(ids, [id], "{path:?}, {level}");
            let again = closed(&first.model, &bundle)
                .expect("the loop closes again")
                .report;
            assert!(
                again.effects.is_empty(),
                "{path:?}, {id}, {level}: {:?}",
                again.effects
            );
            let squares = |e: &Errors| {
                let attitude = e.attitude_rms_arcsec.expect("attitudes have errors");
                let attitude: f64 = attitude.iter().map(|r| r * r).sum();
                [attitude, power(e.star_rms_arcsec)]
            };
            let (was, is) = (squares(&first.report.after), squares(&again.before));
            for (was, is) in was.into_iter().zip(is).filter(|(was, _)| !was.is_nan()) {
                let off = is / was - 1.0;
                assert!(off.abs() < 0.01, "{path:?}, {id}, {level}: {was} {is}");
            }
        }
    }
}

/// Slews to and fro take the stars over the same distortion every 240 s, and an attitude errs with them: no line of
/// the tracker's own, in any of its harmonics. One of 1.5 arcsec is beyond that, and named.
#[test]
fn what_a_motion_makes_of_the_declared_errors_is_no_line() {
    let at = |seed: u64, line: Option<&str>| {
        let mut case = Case::new(Path::Slews, seed);
        case.duration_s = 900.0;
        if let Some(line) = line {
            case = case.with("periodic_misalignment", line);
        }
        let (model, mut bundle) = case.make();
        bundle.stars = None;
        closed(&model, &bundle).expect("the loop closes").report
    };
    for seed in [7, 19, 20] {
        let report = at(seed, None);
        assert!(report.effects.is_empty(), "{seed}: {:?}", report.effects);
        assert!(report.unattributed.lines_hz.is_empty(), "{seed}");
    }
    let line = "frequency_hz = 0.0613\nx_cos_arcsec = 1.5\ny_sin_arcsec = 1.5";
    let report = at(7, Some(line));
    let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!(ids, ["periodic_misalignment"]);
}
