//! What can go wrong when a field is drawn, given, fitted or inverted.

/// Why a distortion field could not be made or undone.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum DistortionError {
    /// The order is above [`MAX_ORDER`](crate::MAX_ORDER).
    #[error("order {order} is above the limit of {limit}")]
    Order {
        /// Order asked for.
        order: usize,
        /// Highest order possible.
        limit: usize,
    },
    /// A standard deviation is negative or not a number.
    #[error("sigma_LSF = {arcsec} arcsec must be finite and not negative")]
    Sigma {
        /// The value given, arcsec.
        arcsec: f64,
    },
    /// A constant has no spread about its mean, so no factor gives it one.
    #[error("a field of order {order} does not vary and cannot be scaled to {arcsec} arcsec")]
    NothingToScale {
        /// Order of the field.
        order: usize,
        /// Per-axis standard deviation asked for, arcsec.
        arcsec: f64,
    },
    /// The number of coefficients does not fit the order.
    #[error("axis {axis}: {got} coefficients given, (order + 1)^2 = {need} needed")]
    Coefficients {
        /// `x` or `y`.
        axis: char,
        /// Coefficients given.
        got: usize,
        /// Coefficients needed.
        need: usize,
    },
    /// A coefficient is infinite or not a number.
    #[error("axis {axis}: coefficient of x^{power_x} y^{power_y} is {value}")]
    Coefficient {
        /// `x` or `y`.
        axis: char,
        /// Power of x it belongs to.
        power_x: usize,
        /// Power of y it belongs to.
        power_y: usize,
        /// The value given.
        value: f64,
    },
    /// A row given to a fit holds a number that is not finite, or a weight that is not positive.
    #[error("row {row}: {name} = {value} cannot enter a fit")]
    Row {
        /// Index of the row.
        row: usize,
        /// Which number of the row.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// A position given to a fit is not normalised, or off the detector.
    #[error("row {row}: ({x}, {y}) is outside the normalised field [-1, 1]")]
    OffField {
        /// Index of the row.
        row: usize,
        /// Normalised x.
        x: f64,
        /// Normalised y.
        y: f64,
    },
    /// Fewer rows than coefficients of one axis.
    #[error("{got} residuals given, at least {need} needed for this order")]
    TooFewRows {
        /// Rows given.
        got: usize,
        /// Coefficients of one axis.
        need: usize,
    },
    /// The positions do not determine the coefficients.
    #[error(
        "the positions do not determine a field of order {order}: condition number {condition:.1e}, limit {limit:.0e}"
    )]
    IllConditioned {
        /// Order of the fit.
        order: usize,
        /// Condition number of the design matrix in the orthonormal basis.
        condition: f64,
        /// Highest condition number accepted.
        limit: f64,
    },
    /// The search for the undistorted position did not settle.
    #[error("row {row}: step still {step_px:.1e} px after {iterations} iterations")]
    NotConverged {
        /// Index of the row.
        row: usize,
        /// Last step, px.
        step_px: f64,
        /// Iterations spent.
        iterations: u32,
    },
}
