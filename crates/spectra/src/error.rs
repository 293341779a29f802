//! What can be wrong with a series or with what is asked of it.
//!
//! Not physics: names of what was refused.

/// Why no spectrum came out.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SpectraError {
    /// A setting has no meaning at this value.
    #[error("{name} = {value} must be finite and positive")]
    NotPositive {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A probability that is none, or that asks for nothing.
    #[error("{name} = {value} must lie between 0 and 1")]
    Probability {
        /// Name of the setting.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// The series, or every run of it, is shorter than what is asked of it.
    #[error("{got} samples in a row given, at least {need} needed")]
    TooShort {
        /// Samples given; of the longest run, where there are several.
        got: usize,
        /// Samples needed.
        need: usize,
    },
    /// A plan for series of one length was given another.
    #[error("{got} samples given to a plan for {planned}")]
    WrongLength {
        /// Samples given.
        got: usize,
        /// Samples the plan was made for.
        planned: usize,
    },
    /// Two series that belong together differ in length.
    #[error("series of {first} and of {second} samples given, of one length needed")]
    Unequal {
        /// Samples of the first.
        first: usize,
        /// Samples of the second.
        second: usize,
    },
    /// A sample is not a number.
    #[error("sample {index} is {value}")]
    NotFinite {
        /// Its place, from 0.
        index: usize,
        /// What stands there.
        value: f64,
    },
    /// Time stands still or goes back.
    #[error("time {time_s} s of sample {index} is not after the one before")]
    NotIncreasing {
        /// Its place, from 0.
        index: usize,
        /// The time there, s.
        time_s: f64,
    },
    /// A run that ends beyond the series, or before its own start.
    #[error("run {start}..{end} does not lie in a series of {samples} samples")]
    Run {
        /// First sample of the run.
        start: usize,
        /// One after its last sample.
        end: usize,
        /// Samples of the series.
        samples: usize,
    },
    /// Segments that overlap wholly never advance.
    #[error("an overlap of {overlap} does not advance a segment of {segment} samples")]
    Overlap {
        /// Samples shared by neighbours.
        overlap: usize,
        /// Samples of a segment.
        segment: usize,
    },
    /// A half-bandwidth that leaves no band, or all of it.
    #[error(
        "time-half-bandwidth product {time_half_bandwidth} must lie between 0 and half of {samples} samples"
    )]
    Bandwidth {
        /// `N W`.
        time_half_bandwidth: f64,
        /// Samples `N`.
        samples: usize,
    },
    /// More tapers than are orthogonal, or fewer than the estimate needs.
    #[error("{got} tapers asked for, {least} to {most} possible")]
    Tapers {
        /// Tapers asked for.
        got: usize,
        /// Fewest possible.
        least: usize,
        /// Most possible.
        most: usize,
    },
    /// A transform shorter than the series.
    #[error("a transform of {transform} cannot hold {samples} samples")]
    Transform {
        /// Length of the transform.
        transform: usize,
        /// Samples of the series.
        samples: usize,
    },
    /// An averaging factor of an Allan deviation that the series cannot fill.
    #[error("averaging factor {factor} must lie between 1 and {most} for this series")]
    Factor {
        /// Averaging factor `m = tau fs`.
        factor: usize,
        /// Largest one.
        most: usize,
    },
}

impl SpectraError {
    /// `value` if it is finite and positive.
    pub(crate) fn positive(name: &'static str, value: f64) -> Result<f64, Self> {
        if value.is_finite() && value > 0.0 {
            Ok(value)
        } else {
            Err(Self::NotPositive { name, value })
        }
    }

    /// `value` if it lies strictly between 0 and 1.
    pub(crate) fn probability(name: &'static str, value: f64) -> Result<f64, Self> {
        if value > 0.0 && value < 1.0 {
            Ok(value)
        } else {
            Err(Self::Probability { name, value })
        }
    }

    /// `Ok` if every one of `x`, counted from `offset`, is finite.
    pub(crate) fn finite(x: &[f64], offset: usize) -> Result<(), Self> {
        match x.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Self::NotFinite {
                index: offset + i,
                value: x[i],
            }),
        }
    }
}
