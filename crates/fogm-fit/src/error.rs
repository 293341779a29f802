//! What can be wrong with a process, a spectrum or a series.

/// Why no process or no fit came out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FogmError {
    /// A parameter that must be finite and positive.
    #[error("{name} = {value} must be finite and positive")]
    NotPositive {
        /// Its name, with unit.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A parameter that must be finite and not negative.
    #[error("{name} = {value} must be finite and not negative")]
    Negative {
        /// Its name, with unit.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// Too little is left for a fit of three parameters.
    #[error("{got} usable {what} given, at least {need} needed")]
    TooFew {
        /// `"samples"` or `"bins"`.
        what: &'static str,
        /// Number usable.
        got: usize,
        /// Number needed.
        need: usize,
    },
    /// A sample is infinite (NaN marks a missing one).
    #[error("sample {index} is infinite")]
    Infinite {
        /// Its index.
        index: usize,
    },
    /// All samples are equal: there is no noise to describe.
    #[error("all samples equal {value}")]
    Constant {
        /// Their value.
        value: f64,
    },
    /// A bin's density or degrees of freedom must be finite and positive.
    #[error("bin {index} at {frequency_hz} Hz: density {psd} with {dof} degrees of freedom")]
    BadBin {
        /// Its index.
        index: usize,
        /// Its frequency, Hz.
        frequency_hz: f64,
        /// Its density, unit^2/Hz.
        psd: f64,
        /// Its degrees of freedom.
        dof: f64,
    },
    /// A range of frequencies with its ends the wrong way round, or not finite.
    #[error("range of frequencies from {from_hz} to {to_hz} Hz")]
    BadRange {
        /// Lower end, Hz.
        from_hz: f64,
        /// Upper end, Hz.
        to_hz: f64,
    },
    /// Columns of a spectrum that differ in length.
    #[error("{frequencies} frequencies, {densities} densities and {dofs} degrees of freedom given")]
    LengthMismatch {
        /// Number of frequencies.
        frequencies: usize,
        /// Number of densities.
        densities: usize,
        /// Number of degrees of freedom.
        dofs: usize,
    },
    /// Missing samples and a choice of frequencies exclude one another.
    #[error("{missing} samples are missing: a band or lines cannot be chosen then")]
    Gaps {
        /// Number of missing samples.
        missing: usize,
    },
    /// Times and samples that differ in number.
    #[error("{times} times and {samples} samples given")]
    Unequal {
        /// Number of times.
        times: usize,
        /// Number of samples.
        samples: usize,
    },
    /// Time stands still or goes back.
    #[error("time {time_s} s of sample {index} is not after the one before")]
    NotIncreasing {
        /// Its place among the samples present, from 0.
        index: usize,
        /// The time there, s.
        time_s: f64,
    },
    /// The optimiser did not return a finite minimum.
    #[error("no finite minimum of the cost found")]
    NotConverged,
}
