//! Three coordinate types on the focal plane that cannot be mixed up.
//!
//! ```text
//! tangent     x = X/Z             focal length 1, the tangent of the angle off the boresight
//! pixel       x = f_x X/Z         0 at the boresight, +-n_x/2 at the edges of the detector
//! normalised  x = pixel / (n_x/2) -1 .. 1 over the detector
//! ```
//!
//! x runs along the columns (tracker X), y along the rows (tracker Y). [`Camera`](crate::Camera)
//! turns one into another; nothing else does.
//!
//! Source: \[M23\] Eq. 1 (pinhole) and Eq. 4 (polynomials over the normalised field).

/// A point in the tangent plane: `x = X/Z`, `y = Y/Z`, no unit.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tangent {
    /// `X/Z`, along the columns.
    pub x: f64,
    /// `Y/Z`, along the rows.
    pub y: f64,
}

/// A point in units of half the detector: -1 to 1 from edge to edge on each axis.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Normalised {
    /// Along the columns, -1 to 1.
    pub x: f64,
    /// Along the rows, -1 to 1.
    pub y: f64,
}

/// A point in centred pixels: 0 at the boresight, one pixel = 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Pixel {
    /// Along the columns, px.
    pub x: f64,
    /// Along the rows, px.
    pub y: f64,
}
