//! A camera that looks arcmins beside its reference: nothing but the misalignment follows.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::{Closed, close};
use focal_plane::{ARCSEC_PER_RAD, rotation_from_vector};
use nalgebra::Vector3;
use scenarios::{Scenario, simulate};

/// Stars of 0.5 arcsec in a field of 20 deg, and what acts; the reference turned by `theta`, arcsec.
fn run(effect: &str, theta: [f64; 3]) -> Closed {
    let text = format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 12
[noise]
temporal_arcsec = 0.5
{effect}
[motion]
kind = "hold"
drift_arcsec_s = [6.0, -9.0, 1.0]
[[motion.sinusoid]]
axis = [1.0, 0.4, 0.0]
amplitude_arcsec = 1800.0
frequency_hz = 0.011
[sky]
kind = "generated"
[reference]
[run]
duration_s = 400.0
rate_hz = 2.0
seed = 3
"#
    );
    let scenario = Scenario::parse(&text, "misalignment.toml").unwrap();
    let mut bundle = simulate(&scenario).unwrap();
    let reference = bundle.reference.as_mut().unwrap();
    let turn = rotation_from_vector(&(Vector3::from(theta) / ARCSEC_PER_RAD)).inverse();
    for q in &mut reference.q {
        *q = turn * *q;
    }
    for rate in reference.rates_rad_s.iter_mut().flatten() {
        *rate = turn * *rate;
    }
    let mut model = scenario.model_without_effects();
    model.noise.bias_arcsec = Some([3600.0; 3]);
    close(&model, &bundle, &|_| ()).unwrap()
}

/// The rest after the first order of 600 arcsec is 1.7 arcsec, three times the noise and a pattern of place: it
/// is gone, to a hundredth of the noise of all rows together, in every figure. What the prior pulls at
/// is the same share of the angle, (0.5/3600)^2 over the rows.
#[test]
fn arcmins_of_misalignment_leave_nothing_behind() {
    let straight = run("", [0.0; 3]);
    let rms = straight.report.before.star_rms_arcsec.unwrap();
    for theta in [[350.0, -420.0, 300.0], [2500.0, 2000.0, -1600.0]] {
        let turned = run("", theta);
        let effects = &turned.report.effects;
        assert!(effects.is_empty(), "{theta:?}: {effects:?}");
        assert!(!turned.report.unattributed.present, "{theta:?}");
        let same = turned.report.before.star_rms_arcsec.unwrap();
        for axis in 0..2 {
            assert!(
                (same[axis] / rms[axis] - 1.0).abs() < 1e-3,
                "{same:?} {rms:?}"
            );
        }
        // the tracker's own attitude, too: its error is that of its stars
        let [own, its] = [&straight, &turned].map(|c| c.report.before.attitude_rms_arcsec.unwrap());
        for axis in 0..3 {
            assert!(
                (own[axis] / its[axis] - 1.0).abs() < 0.02,
                "{own:?} {its:?}"
            );
        }
    }
}

/// A lens that bends by half an arcsec is found beside it as without it: to a tenth of its sigma, and a
/// time tag along a motion that the reference sees half a degree askew.
#[test]
fn effects_beside_a_misalignment_are_what_they_are() {
    for (id, name, value) in [
        ("optical_distortion", "k1", 1e-4),
        ("time_tag_offset", "offset_s", 2e-3),
    ] {
        let effect = format!("[[effect]]\nid = \"{id}\"\n{name} = {value:e}\n");
        let [straight, turned] = [[0.0; 3], [1200.0, -900.0, 1800.0]].map(|theta| {
            let closed = run(&effect, theta);
            let effects = &closed.report.effects;
            assert_eq!(effects.len(), 1, "{effects:?}");
            assert_eq!(effects[0].id, id);
            effects[0].parameters[name].clone()
        });
        let sigma = straight.sigma.unwrap();
        assert!((straight.value - value).abs() < 5.0 * sigma, "{straight:?}");
        assert!(
            (straight.value - turned.value).abs() < 0.1 * sigma,
            "{straight:?} {turned:?}"
        );
    }
}
