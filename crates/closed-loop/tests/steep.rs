//! A declared centroid error as steep as half a pixel a pixel, under a declared distortion of a third of one:
//! where the light falls has to be known before what it errs by is.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::{Closed, close};
use focal_plane::{ARCSEC_PER_RAD, rotation_from_vector};
use nalgebra::Vector3;
use scenarios::{Scenario, simulate};
use telemetry::report::Verdict;

/// A field of 10 deg whose triangle rises by 4.2/8.8 px a px and whose distortion is 10 arcsec, in a circle, of
/// pixels of 35 arcsec; noise of 0.5 arcsec; the camera 50 arcsec beside its reference.
fn run(motion: &str, seed: u64) -> Closed {
    let text = format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [10.0, 10.0]
max_stars = 12
[noise]
temporal_arcsec = 0.5
centroid_arcsec = 4.2
distortion_arcsec = 10.0
distortion_order = 7
[motion]
{motion}
[sky]
kind = "generated"
[reference]
[run]
duration_s = 300.0
rate_hz = 2.0
seed = {seed}
"#
    );
    let scenario = Scenario::parse(&text, "steep.toml").unwrap();
    let mut bundle = simulate(&scenario).unwrap();
    let turn = rotation_from_vector(&(Vector3::new(30.0, -40.0, 20.0) / ARCSEC_PER_RAD)).inverse();
    let reference = bundle.reference.as_mut().unwrap();
    for q in &mut reference.q {
        *q = turn * *q;
    }
    for rate in reference.rates_rad_s.iter_mut().flatten() {
        *rate = turn * *rate;
    }
    close(&scenario.model_without_effects(), &bundle, &|_| ()).unwrap()
}

/// At rest every fold sees its stars at the same places and predicts them: the squares before are those of the
/// noise, 1 +- sqrt(2/14400), and what 2 x 12 places cost out of fold. While the distortion was forgotten whenever
/// the misalignment was projected anew, the triangle was evaluated 0.2 px off and they were up to 61.
#[test]
fn at_rest_the_noise_alone_is_left() {
    for seed in 0..3 {
        let report = run(
            "kind = \"hold\"\ndrift_arcsec_s = [0.06, -0.09, 0.01]",
            seed,
        )
        .report;
        let chi2 = report.before.chi2_per_dof.unwrap();
        assert!(
            (chi2 - 1.0).abs() < 5.0 * (2.0_f64 / 14_400.0).sqrt(),
            "{seed}: {chi2}"
        );
        assert_eq!(
            report.verdict,
            Verdict::Consistent,
            "{seed}: {:?}",
            report.effects
        );
    }
}

/// In slews a fold goes where no other was: there the others know nothing of the distortion, but the light is where
/// all data have it. With positions and outliers out of fold all five were given something, four of them `outliers`,
/// for which up to 1651 of 7200 sound rows were taken.
#[test]
fn in_slews_nothing_is_told() {
    let slew = |axis: &str, angle: f64| {
        format!(
            "[[motion.slew]]\naxis = {axis}\nangle_deg = {angle:?}\nduration_s = 20.0\nhold_s = 20.0\n"
        )
    };
    for seed in 11..16 {
        let motion = format!(
            "kind = \"slews\"\nwait_s = 20.0\n{}{}{}",
            slew("[1.0, 0.0, 0.0]", 1.5),
            slew("[0.0, 1.0, 0.0]", 2.0),
            slew("[1.0, -1.0, 0.0]", -2.5),
        );
        let report = run(&motion, seed).report;
        assert!(
            report.effects.is_empty() && !report.unattributed.present,
            "{seed}: {:?} {:?}",
            report.effects,
            report.unattributed
        );
    }
}
