//! What a set of candidate columns does outside the folds it was fitted on.
//!
//! Not physics: a record.

/// What a set of candidate columns does outside the folds it was fitted on.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OutOfFold {
    /// Squared error of each fold, or block, predicted from the other folds.
    pub sse: Vec<f64>,
    /// Log-likelihood of each, nats, noise variance from the other folds.
    pub loglik: Vec<f64>,
    /// Scalars of each.
    pub scalars: Vec<f64>,
    /// Log-likelihood of what the declared priors of the nuisance say, predicted from all data, nats: up to a
    /// constant of these priors.
    pub prior: f64,
}

/// The noise variance that is held for least, of scalars of this variance in all: a training that leaves less than the
/// rounding of its sums leaves nothing, and of no noise at all any error would be infinitely unlikely.
pub(super) fn least_variance(of_all: f64) -> f64 {
    (f64::EPSILON * of_all).max(f64::MIN_POSITIVE)
}

/// ln of the density of `scalars` of this `variance` with this squared error.
pub(super) fn gaussian(scalars: f64, error: f64, variance: f64) -> f64 {
    -0.5 * (scalars * (std::f64::consts::TAU * variance).ln() + error / variance)
}

impl OutOfFold {
    pub(super) fn add(&mut self, error: f64, scalars: f64, loglik: f64) {
        self.sse.push(error);
        self.loglik.push(loglik);
        self.scalars.push(scalars);
    }

    /// Log-likelihood of the data and of the declared priors, nats: what sets are held against each other by.
    pub fn total_loglik(&self) -> f64 {
        self.data_loglik() + self.prior
    }

    /// Log-likelihood of the data, nats.
    pub fn data_loglik(&self) -> f64 {
        self.loglik.iter().sum()
    }

    /// Sum of the squared errors.
    pub fn total_sse(&self) -> f64 {
        self.sse.iter().sum()
    }
}
