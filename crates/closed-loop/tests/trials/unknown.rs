//! Causes that no catalogue has: what the leftover follows is said, and nothing is named.

use telemetry::Bundle;
use telemetry::report::{Report, Verdict};

use crate::kit::{Case, Path, closed};

/// Magnitude and colour of a star to the variable that it is moved by.
type Of = fn(&[f64; 2]) -> f64;

/// Moves every star along x by `size_px` times its `of` (magnitude, colour), -1 to 1.
fn shifted(bundle: &mut Bundle, size_px: f64, of: Of) {
    let catalog = bundle.catalog.as_ref().expect("a catalogue").clone();
    let value = |id: i64| {
        let at = catalog.index_of(id).expect("a known star");
        let star = &catalog.stars()[at];
        of(&[star.mag, star.bv])
    };
    let stars = bundle.stars.as_mut().expect("stars");
    let values: Vec<f64> = stars.star_id.iter().map(|&id| value(id)).collect();
    let (low, high) = values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), &v| {
            (v.min(l), v.max(h))
        });
    for (x, v) in stars.x_px.iter_mut().zip(&values) {
        *x += size_px * (2.0 * (v - low) / (high - low) - 1.0);
    }
}

fn closes(seed: u64, size_px: f64, of: Of) -> Report {
    let case = Case {
        duration_s: 900.0,
        ..Case::new(Path::Slews, 300 + seed)
    };
    let (model, mut bundle) = case.make();
    shifted(&mut bundle, size_px, of);
    closed(&model, &bundle).expect("the loop closes").report
}

/// A slope of 4 arcsec in magnitude or colour; stars apart from the declared distortion
/// only as far as they move. Without the terms competing, up to four stars are said to be
/// misplaced in the catalogue.
#[test]
fn a_slope_is_not_a_pile_of_stars() {
    let variables: [(&str, Of); 2] = [("mag", |v| v[0]), ("colour", |v| v[1])];
    for (seed, (name, of)) in variables.into_iter().enumerate() {
        let report = closes(seed as u64, 0.057, of);
        let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
        assert!(ids.is_empty(), "{name}: {ids:?}");
        assert_eq!(report.verdict, Verdict::Unexplained, "{name}");
        let first = &report.unattributed.depends_on[0];
        assert_eq!(first.variable, name, "{:?}", report.unattributed);
    }
}
