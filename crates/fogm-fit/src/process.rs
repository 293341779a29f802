//! The process itself: a first-order Gauss-Markov error, alone and with white noise.
//!
//! ```text
//! R(t) = sigma_HSF^2 exp(-|t|/tau) + sigma_TN^2 delta0(t)          [M23] Eq. 15, with |t| (erratum E16)
//!
//! b[0]   = sigma n,   b[k+1] = a b[k] + sigma sqrt(1 - a^2) n,     a = exp(-dt/tau),   n ~ N(0, 1)
//! ```
//!
//! The recursion has exactly the autocovariance above at any step, and is stationary from its first
//! sample. `delta0` is one at zero lag and zero elsewhere: white noise of a sample, not a density.
//! Sigmas are standard deviations in the caller's unit, times are seconds.
//!
//! Source: \[M23\] Eq. 15-16; Gelb (ed.), Applied Optimal Estimation (1974), section 4.3.

use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::FogmError;

/// A first-order Gauss-Markov process.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fogm {
    sigma: f64,
    tau_s: f64,
}

impl Fogm {
    /// A process of standard deviation `sigma` (any unit) and correlation time `tau_s`, s.
    ///
    /// # Errors
    ///
    /// [`FogmError::Negative`] or [`FogmError::NotPositive`] unless `sigma >= 0` and `tau_s > 0`,
    /// both finite.
    pub fn new(sigma: f64, tau_s: f64) -> Result<Self, FogmError> {
        not_negative("sigma", sigma)?;
        positive("tau_s", tau_s)?;
        Ok(Self { sigma, tau_s })
    }

    /// Standard deviation.
    #[must_use]
    pub const fn sigma(self) -> f64 {
        self.sigma
    }

    /// Correlation time, s.
    #[must_use]
    pub const fn tau_s(self) -> f64 {
        self.tau_s
    }

    /// Correlation of two samples `dt_s` apart, `exp(-|dt|/tau)`.
    #[must_use]
    pub fn decay(self, dt_s: f64) -> f64 {
        (-dt_s.abs() / self.tau_s).exp()
    }

    /// Standard deviation of what one step of `dt_s` adds, `sigma sqrt(1 - exp(-2 dt/tau))`.
    #[must_use]
    pub fn drive(self, dt_s: f64) -> f64 {
        // exp_m1 keeps the digits where dt is far below tau
        self.sigma * (-(-2.0 * dt_s.abs() / self.tau_s).exp_m1()).sqrt()
    }

    /// A first sample, drawn from the stationary distribution.
    pub fn start<R: Rng + ?Sized>(self, rng: &mut R) -> f64 {
        let n: f64 = StandardNormal.sample(rng);
        self.sigma * n
    }

    /// Carries `state` over `dt_s` seconds, exactly, whatever the step.
    ///
    /// ```
    /// use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};
    ///
    /// let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    /// let fogm = fogm_fit::Fogm::new(5.0, 30.0)?;
    /// let mut error = fogm.start(&mut rng);
    /// fogm.step(&mut error, 0.1, &mut rng);
    /// # Ok::<(), fogm_fit::FogmError>(())
    /// ```
    pub fn step<R: Rng + ?Sized>(self, state: &mut f64, dt_s: f64, rng: &mut R) {
        let n: f64 = StandardNormal.sample(rng);
        *state = self.decay(dt_s) * *state + self.drive(dt_s) * n;
    }

    /// Fills `out` with samples `dt_s` apart, from a stationary start.
    pub fn simulate_into<R: Rng + ?Sized>(self, dt_s: f64, rng: &mut R, out: &mut [f64]) {
        let (a, drive) = (self.decay(dt_s), self.drive(dt_s));
        let mut state = self.start(rng);
        for value in out {
            *value = state;
            let n: f64 = StandardNormal.sample(rng);
            state = a * state + drive * n;
        }
    }
}

/// A first-order Gauss-Markov process plus white noise, \[M23\] Eq. 15: the sigmas are true standard
/// deviations of one sample, whatever the spectrum they were fitted with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FogmWhite {
    fogm: Fogm,
    sigma_white: f64,
}

impl FogmWhite {
    /// `fogm` with white noise of standard deviation `sigma_white`, same unit.
    ///
    /// # Errors
    ///
    /// [`FogmError::Negative`] unless `sigma_white >= 0` and finite.
    pub fn new(fogm: Fogm, sigma_white: f64) -> Result<Self, FogmError> {
        not_negative("sigma_white", sigma_white)?;
        Ok(Self { fogm, sigma_white })
    }

    /// The correlated part.
    #[must_use]
    pub const fn fogm(self) -> Fogm {
        self.fogm
    }

    /// Standard deviation of the white part.
    #[must_use]
    pub const fn sigma_white(self) -> f64 {
        self.sigma_white
    }

    /// Autocovariance at `lag_s` seconds, \[M23\] Eq. 15.
    #[must_use]
    pub fn autocovariance(self, lag_s: f64) -> f64 {
        let white = if lag_s == 0.0 {
            self.sigma_white * self.sigma_white
        } else {
            0.0
        };
        self.fogm.sigma * self.fogm.sigma * self.fogm.decay(lag_s) + white
    }

    /// One measurement of the correlated `state`: the state plus white noise.
    pub fn measure<R: Rng + ?Sized>(self, state: f64, rng: &mut R) -> f64 {
        let n: f64 = StandardNormal.sample(rng);
        state + self.sigma_white * n
    }

    /// Fills `out` with samples `dt_s` apart, from a stationary start.
    pub fn simulate_into<R: Rng + ?Sized>(self, dt_s: f64, rng: &mut R, out: &mut [f64]) {
        self.fogm.simulate_into(dt_s, rng, out);
        for value in out {
            *value = self.measure(*value, rng);
        }
    }

    /// Fills `out` with samples at the times `t_s`, which need not be evenly spaced, from a stationary
    /// start.
    ///
    /// # Panics
    ///
    /// If `t_s` and `out` differ in length.
    pub fn simulate_at_into<R: Rng + ?Sized>(self, t_s: &[f64], rng: &mut R, out: &mut [f64]) {
        assert_eq!(t_s.len(), out.len(), "one time a sample");
        let mut state = 0.0;
        let mut last_s = None;
        for (&t, value) in t_s.iter().zip(out) {
            match last_s {
                None => state = self.fogm.start(rng),
                Some(last) => self.fogm.step(&mut state, t - last, rng),
            }
            last_s = Some(t);
            *value = self.measure(state, rng);
        }
    }
}

pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), FogmError> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(FogmError::NotPositive { name, value })
    }
}

fn not_negative(name: &'static str, value: f64) -> Result<(), FogmError> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(FogmError::Negative { name, value })
    }
}
