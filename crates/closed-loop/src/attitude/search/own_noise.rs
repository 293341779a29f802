//! A hypothesis at the noise that suits it best.
//!
//! Coloured noise fitted with an effect still in the data takes a slow effect for
//! noise, and noise fitted after removing whatever fits takes noise for an effect.
//! So each hypothesis is scored at its own best noise,
//!
//! ```text
//! L(H) = max over noise, amplitudes of ln p(data | H)
//! ```
//!
//! by alternating generalised least squares and the noise fit, which what is declared of slow noise weighs
//! ([`coloured_noise::Foreknown`]). That climb ends on the hill it starts on:
//! an effect that the noise has swallowed stays swallowed. So there are two, from the noise of the last
//! choice and from little slow noise, and the likelier counts.
//!
//! Source: Cochrane & Orcutt 1949 (the alternation).

use coloured_noise::Coloured;
use effects::Candidate;
use nalgebra::{DMatrix, DVector};

use super::Trial;
use crate::attitude::data::AttitudeEvidence;
use crate::search::selection::columns_of;
use crate::search::{Fitted, first_column, fit_design, without};

/// Rounds of generalised least squares and noise fit.
const ALTERNATIONS: usize = 3;
/// Nats that two parameters of slow noise have to be worth.
const EARNED: f64 = 2.0;
/// Nats that an effect gains under white noise below which no noise makes it significant.
pub(super) const LITTLE: f64 = 8.0;

/// Where the climb to a hypothesis' own noise starts.
#[derive(Clone, Copy, Debug)]
pub(super) enum Start {
    Given,
    Faint,
    /// No slow noise at all.
    White,
}

/// A hypothesis at its best noise.
#[derive(Clone, Debug)]
pub(super) struct Scored {
    pub(super) noise: [Coloured; 3],
    /// Log-likelihood of each axis at the maximum, nats.
    pub(super) of_axis: [f64; 3],
    /// Weight of the noise by what is declared of it, nats.
    weight: f64,
    /// Log-likelihood predicted out of fold, nats.
    pub(super) out_of_fold: f64,
    /// Amplitudes and their robust standard errors are within credible bounds.
    pub(super) credible: bool,
    /// Amplitudes of all columns of the candidates, in order; zero where not observable.
    pub(super) amplitudes: Vec<f64>,
    /// What is left of each axis, bin by bin, arcsec.
    pub(super) left: [Vec<f64>; 3],
}

impl Scored {
    /// Of all axes, weighed by what is declared of their noise.
    pub(super) fn loglik(&self) -> f64 {
        self.of_axis.iter().sum::<f64>() + self.weight
    }
}

impl Trial<'_, '_> {
    /// `chosen` at its own best noise: the likelier of two climbs, from the present noise and, where
    /// white noise would believe all of it, from little slow noise beside it.
    pub(super) fn score(&self, chosen: &[usize]) -> Option<Scored> {
        let (given, faint) = rayon::join(
            || self.climb(chosen, Start::Given),
            || {
                self.believed(chosen)
                    .then(|| self.climb(chosen, Start::Faint))?
            },
        );
        let both = [given, faint].into_iter().flatten();
        both.max_by(|a, b| a.loglik().total_cmp(&b.loglik()))
    }

    /// Whether each of `chosen` explains something beside the others if the noise is white.
    fn believed(&self, chosen: &[usize]) -> bool {
        let fits = &self.plain.fits;
        let error = |set: &[usize]| fits.error(&columns_of(&self.plain.groups, set));
        let Some(all) = error(chosen) else {
            return false;
        };
        chosen.iter().all(|g| {
            let others = without(chosen, &[*g]);
            error(&others).is_some_and(|e| self.plain.nats(e, all) > LITTLE)
        })
    }

    /// `chosen`, and its noise uphill from the present one, or each time from little slow noise.
    pub(super) fn climb(&self, chosen: &[usize], start: Start) -> Option<Scored> {
        let candidates: Vec<&dyn Candidate> = chosen
            .iter()
            .map(|&g| self.candidates[g].as_ref())
            .collect();
        let columns = candidates.iter().map(|c| c.coefficients().len()).sum();
        let all: Vec<usize> = (0..candidates.len()).collect();
        let binned = self.columns(chosen);
        let mut noise = match start {
            Start::Given => self.noise,
            Start::Faint | Start::White => self.white,
        };
        let mut last = None;
        for _ in 0..ALTERNATIONS {
            let evidence = (self.with_noise)(noise);
            let design = evidence.whitened(&binned);
            let fitted = fit_design(&evidence, design.as_ref(), self.folds, &candidates).ok()?;
            let set = columns_of(&fitted.groups, &all);
            let estimate = fitted.fits.estimate(&set)?;
            let residual = self.left(&evidence, &binned, &fitted, &set, &estimate.value);
            noise = std::array::from_fn(|axis| {
                let (t_s, count) = (&self.data.bins.t_s, &self.data.count[axis]);
                match (start, &self.declared.noise[axis]) {
                    (Start::White, _) => self.white_of(axis, &residual[axis]),
                    (_, Some(known)) => noise[axis].refit_near(known, t_s, &residual[axis], count),
                    (Start::Given, None) => noise[axis].refit(t_s, &residual[axis], count),
                    (Start::Faint, None) => self.climbing_from_faint(axis, &residual[axis]),
                }
            });
            let mut first = 0;
            let credible = fitted.groups.iter().all(|group| {
                let own = first;
                first += group.columns.len();
                group.believes(&group.columns, &estimate, own)
            });
            let mut all = vec![0.0; columns];
            for (value, &c) in estimate.value.iter().zip(&set) {
                all[c] = *value;
            }
            last = Some((self.logliks(&noise, &residual), credible, all, residual));
        }
        let (of_axis, credible, values, left) = last?;
        let evidence = (self.with_noise)(noise);
        let design = evidence.whitened(&binned);
        let fitted = fit_design(&evidence, design.as_ref(), self.folds, &candidates).ok()?;
        let set = columns_of(&fitted.groups, &all);
        let out_of_fold = fitted.fits.out_of_fold(&set)?.total_loglik();
        Some(Scored {
            noise,
            of_axis,
            weight: match start {
                Start::White => 0.0,
                Start::Given | Start::Faint => self.declared.weight(&noise),
            },
            out_of_fold: out_of_fold + self.log_scale(&noise),
            credible,
            amplitudes: values,
            left,
        })
    }

    /// Noise of a residual: white, unless slow noise beside it earns its two parameters (Akaike).
    fn climbing_from_faint(&self, axis: usize, residual: &[f64]) -> Coloured {
        let (t_s, count) = (&self.data.bins.t_s, &self.data.count[axis]);
        let white = self.white_of(axis, residual);
        let found = self.faint[axis].refit(t_s, residual, count);
        let loglik = |noise: &Coloured| noise.log_likelihood(t_s, residual, count);
        if loglik(&found) > loglik(&white) + EARNED {
            found
        } else {
            white
        }
    }

    /// White noise of a residual.
    fn white_of(&self, axis: usize, residual: &[f64]) -> Coloured {
        let count = &self.data.count[axis];
        let rows = count.iter().filter(|n| **n > 0.0).count().max(1) as f64;
        let square: f64 = residual.iter().zip(count).map(|(y, n)| n * y * y).sum();
        Coloured {
            white: (square / rows).sqrt().max(f64::MIN_POSITIVE),
            ..self.white[axis]
        }
    }

    /// Binned columns of some candidates, constants first.
    pub(super) fn columns(&self, chosen: &[usize]) -> DMatrix<f64> {
        let mut pick = vec![0, 1, 2];
        for &g in chosen {
            let before = first_column(self.candidates, g);
            pick.extend((0..self.candidates[g].coefficients().len()).map(|j| 3 + before + j));
        }
        self.binned.select_columns(&pick)
    }

    /// What is left in sample.
    fn left(
        &self,
        evidence: &AttitudeEvidence<'_>,
        binned: &DMatrix<f64>,
        fitted: &Fitted,
        set: &[usize],
        value: &DVector<f64>,
    ) -> [Vec<f64>; 3] {
        let mut beta = DVector::zeros(binned.ncols() - 3);
        for (i, &c) in set.iter().enumerate() {
            beta[c] = value[i];
        }
        evidence.left(binned, &fitted.fits.nuisance(None, set, value), &beta)
    }

    /// What the log-likelihood of whitened values lacks to that of the values themselves, nats.
    fn log_scale(&self, noise: &[Coloured; 3]) -> f64 {
        let nothing = std::array::from_fn(|_| vec![0.0; self.data.bins.t_s.len()]);
        let all = self.data.count.iter().flatten();
        let scalars = all.filter(|n| **n > 0.0).count() as f64;
        self.loglik(noise, &nothing) + 0.5 * scalars * std::f64::consts::TAU.ln()
    }

    fn loglik(&self, noise: &[Coloured; 3], residual: &[Vec<f64>; 3]) -> f64 {
        self.logliks(noise, residual).iter().sum()
    }

    fn logliks(&self, noise: &[Coloured; 3], residual: &[Vec<f64>; 3]) -> [f64; 3] {
        std::array::from_fn(|a| {
            noise[a].log_likelihood(&self.data.bins.t_s, &residual[a], &self.data.count[a])
        })
    }
}
