//! Effects on the noise level, by the whole loop: named, with the right size, and alone.

use crate::kit::{Case, Path};

/// Closes the loop where `id` acts with `lines`; holds `parameter` against `truth`.
fn finds(id: &str, lines: &str, parameter: &str, truth: f64) {
    let report = Case::new(Path::Slews, 1).with(id, lines).close().report;
    let named: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
    assert_eq!(named, [id], "{:?}", report.effects);
    assert!(report.considered.iter().all(|c| c.id != id));
    let got = &report.effects[0].parameters[parameter];
    let z = (got.value - truth) / got.sigma.expect("a sigma");
    assert!(z.abs() < 4.0, "{got:?}, truth {truth}");
}

#[test]
fn magnitude_noise() {
    finds("magnitude_noise", "slope = 1.0", "slope", 1.0);
}

#[test]
fn rate_noise() {
    finds(
        "rate_noise",
        "arcsec_per_deg_s = 80.0",
        "arcsec_per_deg_s",
        80.0,
    );
}

#[test]
fn outliers() {
    finds("outliers", "rate = 0.01\nsize_arcsec = 90.0", "rate", 0.01);
}
