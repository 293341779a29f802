//! Series and tables that several tests share.
use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

/// Standard normal numbers.
pub(crate) fn white(samples: usize, seed: u64) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    (0..samples)
        .map(|_| StandardNormal.sample(&mut rng))
        .collect()
}

/// `x[n] = phi x[n-1] + e[n]`, stationary from the first sample.
pub(crate) fn autoregressive(phi: f64, samples: usize, seed: u64) -> Vec<f64> {
    let mut state = None;
    white(samples, seed)
        .into_iter()
        .map(|e| {
            let next = state.map_or(e / (1.0 - phi * phi).sqrt(), |last: f64| phi * last + e);
            state = Some(next);
            next
        })
        .collect()
}

/// A recorded table, as text by column.
#[derive(Debug)]
pub(crate) struct Table(Vec<BTreeMap<String, String>>);

impl Table {
    pub(crate) fn read(name: &str) -> Result<Self, Box<dyn Error>> {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/oracles/spectra");
        let mut reader = csv::Reader::from_path(folder.join(name))?;
        Ok(Self(reader.deserialize().collect::<Result<_, _>>()?))
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.0.iter().map(Row)
    }

    pub(crate) fn column(&self, name: &str) -> Result<Vec<f64>, Box<dyn Error>> {
        self.rows().map(|r| r.number(name)).collect()
    }
}

/// A row of a recorded table.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Row<'a>(&'a BTreeMap<String, String>);

impl<'a> Row<'a> {
    pub(crate) fn text(self, name: &str) -> Result<&'a str, Box<dyn Error>> {
        Ok(self.0.get(name).ok_or_else(|| name.to_owned())?)
    }

    pub(crate) fn number(self, name: &str) -> Result<f64, Box<dyn Error>> {
        Ok(self.text(name)?.parse()?)
    }

    pub(crate) fn count(self, name: &str) -> Result<usize, Box<dyn Error>> {
        Ok(self.text(name)?.parse()?)
    }
}

/// Fails unless `got` is within `tolerance` of `expected`, relative to `scale`.
#[track_caller]
pub(crate) fn close(
    got: f64,
    expected: f64,
    scale: f64,
    tolerance: f64,
    what: impl std::fmt::Debug,
) {
    assert!(
        (got - expected).abs() <= tolerance * scale,
        "{what:?}: {got:e}, expected {expected:e} within {tolerance:e} of {scale:e}"
    );
}

/// Mean of a sample and the standard error of this mean.
pub(crate) fn mean_and_error(values: &[f64]) -> [f64; 2] {
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let square: f64 = values.iter().map(|v| (v - mean).powi(2)).sum();
    [mean, (square / (count - 1.0) / count).sqrt()]
}

/// Share of `true` is within five standard errors of a binomial share, plus `slack`.
#[track_caller]
pub(crate) fn share(hits: usize, trials: usize, expected: f64, slack: f64, what: &str) {
    let got = hits as f64 / trials as f64;
    let error = (expected * (1.0 - expected) / trials as f64).sqrt();
    assert!(
        (got - expected).abs() < 5.0 * error + slack,
        "{what}: {got} of {trials}, expected {expected} +- {error:.1e} + {slack}"
    );
}
