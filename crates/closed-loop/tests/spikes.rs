//! The size of spikes beside few stars: a spike turns its frame, and what is left of it says how far.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use std::collections::BTreeMap;

use closed_loop::close;
use scenarios::{Scenario, simulate};
use telemetry::report::Estimate;

/// Of one run, what is told of its spikes: six stars of 3 arcsec, 600 frames, one row of fifty with a spike.
fn told(seed: u64, size_arcsec: f64) -> BTreeMap<String, Estimate> {
    let text = format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 6
[noise]
temporal_arcsec = 3.0
[[effect]]
id = "outliers"
rate = 0.02
size_arcsec = {size_arcsec:?}
[motion]
kind = "hold"
[sky]
kind = "generated"
[reference]
[run]
duration_s = 300.0
rate_hz = 2.0
seed = {seed}
"#
    );
    let scenario = Scenario::parse(&text, "spikes.toml").unwrap();
    let bundle = simulate(&scenario).unwrap();
    let closed = close(&scenario.model_without_effects(), &bundle, &|_| ()).unwrap();
    let found = &closed.report.effects;
    assert_eq!(found.len(), 1, "seed {seed}: {found:?}");
    assert_eq!(found[0].id, "outliers");
    found[0].parameters.clone()
}

/// Of n spikes on two axes the logarithm of the size is known to 1 / (2 sqrt n): 72 in a run, 864 in twelve, 1.7 %,
/// and 5 sigma of the mean are allowed. Held against the noise of a row alone, sizes come out a ninth too small:
/// a row turns a frame of six stars by a fourth of its variance.
#[test]
fn spikes_beside_few_stars_keep_their_size() {
    let off = |seed: u64| (told(seed, 60.0)["size_arcsec"].value / 60.0).ln();
    let mean = (1..=12).map(off).sum::<f64>() / 12.0;
    assert!(mean.abs() < 5.0 * 0.017, "{mean}");
}

/// Stars that are taken for others lie anywhere in the field: a hundred and a thousand sigmas off, none of whose rows
/// counts, and each is in a share of a known size.
#[test]
fn spikes_across_the_field_are_told() {
    for (seed, size) in [(1, 300.0), (2, 3000.0)] {
        let told = told(seed, size);
        for (name, truth) in [("rate", 0.02), ("size_arcsec", size)] {
            let got = &told[name];
            let z = (got.value - truth) / got.sigma.unwrap();
            assert!(z.abs() < 4.0, "{name}: {got:?}, truth {truth}");
        }
    }
}
