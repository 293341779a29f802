//! Effects on the noise level, by the whole loop: named, with the right size, and alone.

use focal_plane::{rotation_from_vector, rotation_vector};
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use crate::kit::{Case, Path, closed};

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

/// What the noise follows that all stars of a frame share, where the reference is late by `jitter_s` times a normal
/// number, by turns early; and that of single stars.
fn shared(path: Path, jitter_s: f64, seed: u64) -> [Vec<String>; 2] {
    let (model, mut bundle) = Case::new(path, seed).make();
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let reference = bundle.reference.as_mut().expect("a reference");
    let (t_s, q) = (reference.t_s.clone(), reference.q.clone());
    for k in 1..q.len() - 1 {
        let z: f64 = StandardNormal.sample(&mut rng);
        let rate = rotation_vector(&q[k + 1], &q[k - 1]) / (t_s[k + 1] - t_s[k - 1]);
        reference.q[k] = rotation_from_vector(&(rate * (jitter_s * z))) * q[k];
    }
    let report = closed(&model, &bundle).expect("the loop closes").report;
    let left = report.unattributed;
    [left.shared_noise_depends_on, left.noise_depends_on]
        .map(|told| told.into_iter().map(|d| d.variable).collect())
}

/// Time tags that jitter by 20 ms, of a reference that turns by up to 300 arcsec/s about X and Y and 1700 about Z: 6 and
/// 34 arcsec at most beside the 1.5 and 12 that twelve stars leave of a frame. No star shows it beside the others.
#[test]
fn jitter_of_the_time_tags_follows_the_rate() {
    for seed in 1..4 {
        let [told, own] = shared(Path::Slews, 0.02, seed);
        assert_eq!(told.first().map(String::as_str), Some("rate"), "{seed}");
        assert!(own.is_empty(), "{own:?}");
        let [none, _] = shared(Path::Slews, 0.0, seed);
        assert!(none.is_empty(), "{none:?}");
    }
}
