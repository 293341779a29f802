//! A pattern on the detector that is in no catalogue.

use telemetry::report::Verdict;

use crate::kit::{Case, Path, closed};

/// A diagonal fringe of 1.5 arcsec with a pitch that is no whole pixel.
fn fringe(x: f64, y: f64) -> f64 {
    1.5 * (std::f64::consts::TAU * (x + 0.7 * y) / 7.3).sin()
}

/// 12 stars in 840 frames under noise of 5.25 arcsec: sqrt(10080 / 2) * 1.5 / 5.25 = 20 sigma. No effect has
/// it, and no function of one variable.
#[test]
fn a_diagonal_fringe_is_left_and_named() {
    for path in [Path::Drift, Path::Slews, Path::Turns] {
        let (model, mut bundle) = Case::new(path, 2000).make();
        let stars = bundle.stars.as_mut().expect("the trial has stars");
        for row in 0..stars.x_px.len() {
            // arcsec per pixel: 20 degrees over 1024 pixels
            stars.x_px[row] += fringe(stars.x_px[row], stars.y_px[row]) / 70.5;
        }
        let report = closed(&model, &bundle).expect("the loop closes").report;
        let left = &report.unattributed;
        assert_eq!(report.verdict, Verdict::Unexplained, "{path:?}: {left:?}");
        let first = left.depends_on.first().expect("something is left");
        assert_eq!(first.variable, "x_px*y_px", "{path:?}: {left:?}");
        // 1.5^2 / 2 of that and of 2 * 5.25^2: 0.020, less what one attitude a frame takes
        assert!(
            (0.012..0.028).contains(&first.variance_explained),
            "{path:?}: {first:?}"
        );
    }
}

/// The chance is 1 % a bundle at most. `BORESIGHT_SEEDS` takes more of each kind.
#[test]
fn nothing_follows_the_detector_where_nothing_acts() {
    let seeds: u64 = option_env!("BORESIGHT_SEEDS")
        .and_then(|n| n.parse().ok())
        .unwrap_or(1);
    let mut alarms = 0;
    for path in [Path::Drift, Path::Slews, Path::Turns] {
        for (kind, reference) in ["", "none", "wander_arcsec = [0.5, 0.5, 0.5]"]
            .into_iter()
            .enumerate()
        {
            for seed in 0..seeds {
                let left = Case::new(path, 3000 + 100 * kind as u64 + seed)
                    .reference(reference)
                    .close()
                    .report
                    .unattributed;
                let found = left
                    .depends_on
                    .iter()
                    .any(|d| d.variable.contains("px*") && d.p_value < 0.01);
                if found {
                    println!("{path:?}, {reference}, {seed}: {left:?}");
                }
                alarms += u64::from(found);
            }
        }
    }
    println!("{alarms} of {}", 9 * seeds);
    assert!(alarms <= seeds / 4, "{alarms} alarms");
}

/// The tracker of a case on whose detector `shift` (arcsec, of x and y in px) moves x, and what is left of that.
fn left_of(case: Case, shift: impl Fn(f64, f64) -> f64) -> Option<String> {
    let (model, mut bundle) = case.make();
    let stars = bundle.stars.as_mut().expect("the trial has stars");
    for row in 0..stars.x_px.len() {
        stars.x_px[row] += shift(stars.x_px[row], stars.y_px[row]) / 70.5;
    }
    let report = closed(&model, &bundle).expect("the loop closes").report;
    let left = report.unattributed;
    let first = left.depends_on.first().filter(|_| left.present)?;
    (report.verdict == Verdict::Unexplained).then(|| first.variable.clone())
}

/// A part of the detector beyond an edge, which is not its middle, a blemish a seventh of the detector wide, and the
/// product of a wave in each pixel phase, of 2, 8 and 1.4 arcsec under noise of 5.25: no polynomial of the place and no
/// harmonic has them. 12 stars in 840 frames know a shift of all of them to 5.25/sqrt(10080) = 0.05 arcsec; the declared
/// distortion takes most of what is smooth in it.
#[test]
fn places_on_the_detector_are_named() {
    let edge = |x: f64, _: f64| if x > 90.0 { 2.0 } else { 0.0 };
    let blemish = |x: f64, y: f64| {
        let (x, y) = (x - 40.0, y + 60.0);
        8.0 * (-(x * x + y * y) / (2.0 * 70.0 * 70.0)).exp()
    };
    let turn = std::f64::consts::TAU;
    let phases = |x: f64, y: f64| 1.4 * (turn * x).sin() * (turn * y).sin();
    let mut blemishes = 0;
    for seed in 4000..4003 {
        let scan = || Case::new(Path::Scan, seed);
        assert_eq!(left_of(scan(), edge).as_deref(), Some("x_px"), "{seed}");
        blemishes += u32::from(left_of(scan(), blemish).as_deref() == Some("x_px*y_px"));
        assert_eq!(
            left_of(scan(), phases).as_deref(),
            Some("pixel_phase_x*pixel_phase_y"),
            "{seed}"
        );
    }
    // one star that comes by once is that star for a while
    assert!(blemishes >= 2, "{blemishes} of 3");
}
