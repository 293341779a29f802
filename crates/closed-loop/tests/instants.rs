//! Errors of what enters non-linearly: the instant of a step and the frequency of a line.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::close;
use scenarios::{Scenario, simulate};
use telemetry::report::Estimate;

/// Attitudes of a tracker at rest with white noise of some arcsec, and an effect.
fn parameter(effect: &str, id: &str, name: &str, seed: u64) -> Estimate {
    let text = format!(
        r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 8
[noise]
temporal_arcsec = 7.43
[[effect]]
id = "{id}"
{effect}
[motion]
kind = "hold"
[sky]
kind = "generated"
[reference]
[run]
duration_s = 300.0
rate_hz = 2.0
seed = {seed}
tables = ["attitude"]
"#
    );
    let scenario = Scenario::parse(&text, "instants.toml").unwrap();
    let bundle = simulate(&scenario).unwrap();
    let closed = close(&scenario.model_without_effects(), &bundle, &|_| ()).unwrap();
    let found = &closed.report.effects;
    assert_eq!(found.len(), 1, "seed {seed}: {found:?}");
    assert_eq!(found[0].id, id);
    found[0].parameters[name].clone()
}

/// Bounds of 95 %: of 12 the truth is outside more than 4 twice in 10 000.
#[test]
fn the_instant_of_a_step_lies_within_its_bounds() {
    let (mut inside, mut widths) = (0, 0.0);
    for seed in 1..=12 {
        let at = parameter(
            "at_s = 140.3\nx_arcsec = 2.4\ny_arcsec = -1.6",
            "step_misalignment",
            "at_s",
            seed,
        );
        let [low, high] = at.interval.unwrap();
        assert!(at.sigma.is_none() && low <= at.value && at.value <= high);
        inside += usize::from((low..=high).contains(&140.3));
        widths += (high - low) / 12.0;
    }
    assert!(inside >= 8, "{inside} of 12");
    // the noise of a frame is half as large as the step: some frames, not the span
    assert!(widths > 1.0 && widths < 60.0, "{widths} s");
}

/// z of the frequency over 12 seeds has unit rms to 5/sqrt(24), and its sigma is that of theory,
/// sqrt(6) s / (pi T a sqrt(2 n)), s the noise and a the amplitude on each of two axes.
#[test]
fn the_error_of_a_frequency_is_honest() {
    let mut sum = 0.0;
    for seed in 1..=12 {
        let f = parameter(
            "frequency_hz = 0.0213\nx_cos_arcsec = 1.5\ny_sin_arcsec = 1.5",
            "periodic_misalignment",
            "frequency_hz",
            seed,
        );
        let sigma = f.sigma.unwrap();
        sum += ((f.value - 0.0213) / sigma).powi(2);
        // 9.3e-5 Hz for s = 7.43/sqrt(2 * 8); the stars, and with them s, differ from seed to seed
        assert!((7e-5..1.3e-4).contains(&sigma), "{sigma}");
    }
    let rms = (sum / 12.0_f64).sqrt();
    assert!((rms - 1.0).abs() < 5.0 / 24.0_f64.sqrt(), "rms z {rms}");
}
