//! Why a centroid could not be formed.
//!
//! Not physics: the reasons, with their numbers.

/// Why a window has no centroid, or a model no meaning.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CentroidFailure {
    /// A setting is out of its range.
    #[error("{name} = {value} is out of its range")]
    Setting {
        /// Which one.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A pixel that was read holds something that is not a number.
    #[error("pixel at row {row}, column {column} is {value}")]
    Pixel {
        /// Row of the pixel, along y.
        row: usize,
        /// Column of the pixel, along x.
        column: usize,
        /// Its value.
        value: f64,
    },
    /// The window is larger than the working memory on the stack.
    #[error("window side {side} px is above the limit of {limit} px")]
    WindowTooLarge {
        /// Longest side, px.
        side: usize,
        /// Longest side possible, px.
        limit: usize,
    },
    /// The pixels left by mask and threshold do not span two rows and two columns.
    #[error("{pixels} usable pixels do not span two rows and two columns")]
    TooFewPixels {
        /// Pixels left.
        pixels: u32,
    },
    /// Nothing is left above the background.
    #[error("flux {flux} above the background is not positive")]
    NoFlux {
        /// Sum of what is above the background, units of the window.
        flux: f64,
    },
    /// The star is too faint for a formal error to mean anything.
    #[error("signal to noise {signal_to_noise:.2} is below {need}")]
    TooFaint {
        /// Flux over its standard deviation.
        signal_to_noise: f64,
        /// Least ratio asked for.
        need: f64,
    },
    /// The centroid lies off the window.
    #[error("centroid ({x_px}, {y_px}) is off the window")]
    OutsideWindow {
        /// Where it went, px.
        x_px: f64,
        /// Where it went, px.
        y_px: f64,
    },
    /// The iteration did not settle.
    #[error("step still {step_px:.1e} px after {iterations} iterations")]
    NotConverged {
        /// Iterations spent.
        iterations: u32,
        /// Last step, px.
        step_px: f64,
    },
    /// The pixels do not fix the position: no maximum of the weighted flux is there.
    #[error("the pixels do not fix the position")]
    NotDetermined,
}

/// A setting that must be finite and positive.
pub(crate) fn positive(name: &'static str, value: f64) -> Result<(), CentroidFailure> {
    if value.is_finite() && value > 0.0 {
        Ok(())
    } else {
        Err(CentroidFailure::Setting { name, value })
    }
}

/// A setting that must be finite and not negative.
pub(crate) fn not_negative(name: &'static str, value: f64) -> Result<(), CentroidFailure> {
    if value.is_finite() && value >= 0.0 {
        Ok(())
    } else {
        Err(CentroidFailure::Setting { name, value })
    }
}
