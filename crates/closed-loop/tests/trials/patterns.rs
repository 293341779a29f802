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
