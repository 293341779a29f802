//! How honest the fits are: many simulated series per case, over correlation times, ratios of the
//! sigmas and lengths.
//!
//! `cargo run --release -p fogm-fit --example calibration -- [series per case] [longest] [shortest] [least span in tau] [spectrum]`
//!
//! Series are sampled at 10 Hz. One line a case and parameter: how often it was estimated, bounded or
//! declared open; bias in standard errors and mean claimed sigma over observed scatter of the estimates; how
//! often an interval or bound missed the truth, of all series; how often the intervals of estimates
//! held it; and how often the truth lay above. A case fails where the span is at least 50 tau and the
//! bias exceeds a quarter, or the claim is off by over 10 % and two standard
//! errors of the study itself, or anywhere when over 10 % of the
//! series say something wrong.
#![expect(clippy::print_stdout, reason = "a study prints its table")]

use fogm_fit::{Estimate, FitOptions, Fogm, FogmError, FogmWhite, fit_series};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use rayon::prelude::*;

const FS_HZ: f64 = 10.0;
const SIGMA_TN: f64 = 1.0;
const TAUS_S: [f64; 5] = [5.0, 16.0, 50.0, 160.0, 500.0];
const RATIOS: [f64; 5] = [0.2, 0.45, 1.0, 2.2, 5.0];
const LENGTHS: [usize; 3] = [1000, 10_000, 100_000];

/// What all series of a case said of one parameter.
#[derive(Default)]
struct Tally {
    values: Vec<f64>,
    sigmas: Vec<f64>,
    bounded: usize,
    open: usize,
    /// Statements of an interval or bound, and those that held the truth.
    stated: usize,
    held: usize,
    below: usize,
    /// Estimates whose interval held the truth.
    estimated_held: usize,
}

impl Tally {
    fn add(&mut self, estimate: &Estimate, truth: f64, applies: bool) {
        match estimate {
            Estimate::Estimated { value, sigma, .. } => {
                self.values.push(*value);
                self.sigmas.push(*sigma);
            }
            Estimate::Undetermined { .. } => self.open += 1,
            _ => self.bounded += 1,
        }
        let Some([low, high]) = estimate.interval() else {
            return;
        };
        if !applies && estimate.value().is_none() {
            return;
        }
        self.stated += 1;
        if (low..=high).contains(&truth) {
            self.held += 1;
            self.estimated_held += usize::from(estimate.value().is_some());
        } else if truth > high {
            self.below += 1;
        }
    }

    /// Bias in units of the scatter, claimed over observed scatter.
    fn moments(&self, truth: f64) -> (f64, f64) {
        let n = self.values.len() as f64;
        let mean = self.values.iter().sum::<f64>() / n;
        let scatter =
            (self.values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0)).sqrt();
        let claimed = self.sigmas.iter().sum::<f64>() / n;
        ((mean - truth) / scatter, claimed / scatter)
    }
}

fn main() -> Result<(), FogmError> {
    let mut arguments = std::env::args().skip(1).map(|a| a.parse::<usize>());
    let series = arguments.next().and_then(Result::ok).unwrap_or(400);
    let longest = arguments.next().and_then(Result::ok).unwrap_or(100_000);
    let shortest = arguments.next().and_then(Result::ok).unwrap_or(0);
    println!(
        "{:>6} {:>5} {:>7} {:>8}  {:<10} {:>4} {:>4} {:>4}  {:>6} {:>6}  {:>6} {:>6} {:>6}",
        "tau",
        "ratio",
        "n",
        "span/tau",
        "parameter",
        "est",
        "bnd",
        "open",
        "bias",
        "claim",
        "wrong%",
        "in%",
        "below%"
    );
    let spans = arguments.next().and_then(Result::ok).unwrap_or(0);
    // any last argument: the fit of a spectrum, as with a chosen band
    let options = FitOptions {
        band_hz: arguments.next().map(|_| [0.0, 0.5 * FS_HZ]),
        ..FitOptions::default()
    };
    let mut failures = 0;
    for n in LENGTHS
        .into_iter()
        .filter(|n| (shortest..=longest).contains(n))
    {
        for tau in TAUS_S {
            if (n as f64) < spans as f64 * tau * FS_HZ {
                continue;
            }
            for ratio in RATIOS {
                failures += case(tau, ratio, n, series, &options)?;
            }
        }
    }
    println!("{failures} failures");
    Ok(())
}

fn case(
    tau: f64,
    ratio: f64,
    n: usize,
    series: usize,
    options: &FitOptions,
) -> Result<usize, FogmError> {
    let truth = FogmWhite::new(Fogm::new(ratio * SIGMA_TN, tau)?, SIGMA_TN)?;
    // every case its own series
    let first_seed = tau.to_bits().rotate_left(20) ^ ratio.to_bits().rotate_left(40) ^ n as u64;
    let begun = std::time::Instant::now();
    let fits: Vec<_> = (0..series as u64)
        .into_par_iter()
        .map(|seed| {
            let mut y = vec![0.0; n];
            truth.simulate_into(
                1.0 / FS_HZ,
                &mut Xoshiro256PlusPlus::seed_from_u64(first_seed.wrapping_add(seed)),
                &mut y,
            );
            fit_series(&y, FS_HZ, options)
        })
        .collect::<Result<_, _>>()?;
    let each = begun.elapsed().as_secs_f64() / series as f64;
    let span = n as f64 / FS_HZ;
    let truths = [ratio * SIGMA_TN, tau, SIGMA_TN];
    let mut failures = 0;
    for (i, name) in ["sigma_hsf", "tau", "sigma_tn"].into_iter().enumerate() {
        let mut tally = Tally::default();
        for fit in &fits {
            let estimate = [fit.sigma_hsf, fit.tau_s, fit.sigma_tn][i];
            // a bound on sigma_HSF speaks of correlation times within the span
            tally.add(&estimate, truths[i], i != 0 || tau <= span);
        }
        let (bias, claim) = tally.moments(truths[i]);
        let share = |k: usize, n: usize| 100.0 * k as f64 / n as f64;
        let wrong = share(tally.stated - tally.held, series);
        // two standard errors of the observed scatter
        let chance = 2.0 / (2.0 * series as f64).sqrt();
        let asymptotic = span >= 50.0 * tau;
        let fails = (asymptotic && (bias.abs() > 0.25 || (claim - 1.0).abs() > 0.1 + chance))
            || wrong > 10.0;
        failures += usize::from(fails);
        println!(
            "{tau:>6} {ratio:>5} {n:>7} {:>8.2}  {name:<10} {:>4} {:>4} {:>4}  {bias:>6.2} {claim:>6.2}  {wrong:>6.1} {:>6.1} {:>6.1} {} {:.1} ms",
            span / tau,
            tally.values.len(),
            tally.bounded,
            tally.open,
            share(tally.estimated_held, tally.values.len()),
            share(tally.below, series),
            if fails { "FAIL" } else { "" },
            1e3 * each,
        );
    }
    Ok(failures)
}
