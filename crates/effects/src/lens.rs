//! What a lens and a detector behind it do to an image: the map and its slopes.
//!
//! ```text
//! u               tangent-plane position,  w  the same about the axis through the centre c,  r = |w|
//! v    = u + u (t . u) + w (k1 r^2 + k2 r^4 + k3 r^6) + (2 p1 x y + p2 (r^2 + 2 x^2), p1 (r^2 + 2 y^2) + 2 p2 x y)      (x, y) = w
//! u'   = v + (k0 + b1, b2; 0, k0) v
//! w    = (n u - c - c (u . c) / (1 + n)) / (1 + u . c),      n^2 = 1 + c . c
//! ```
//!
//! The lens bends what the detector then sees in its own plane and in its own pixels: where both are far off,
//! one after the other is not their sum. w is u turned so that c lies in the middle.
//!
//! Source: Brown, "Decentering distortion of lenses", Photogrammetric Engineering 32 (1966) 444; Fraser, "Digital
//! camera self-calibration", ISPRS Journal of Photogrammetry 52 (1997) 149 (b1, b2); a plane seen through a pinhole
//! at an angle, to first order (t1, t2); the slopes by the chain rule.

/// Coefficients by name.
pub(crate) const TERMS: [&str; 10] = ["k0", "k1", "k2", "k3", "p1", "p2", "b1", "b2", "t1", "t2"];
const COUNT: usize = TERMS.len();

/// Displacement of an image, and what its slopes by the coefficients are made of.
pub(crate) struct Bend {
    pub(crate) shift: [f64; 2],
    /// v, and its slopes: by k1 to p2, by t1 and t2.
    bent: [f64; 2],
    lens: [[f64; 2]; 5],
    tilt: [[f64; 2]; 2],
    pixels: Pixels,
}

/// What pixels make of v.
#[derive(Clone, Copy)]
struct Pixels {
    k0: f64,
    b1: f64,
    b2: f64,
}

impl Pixels {
    fn read(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let Self { k0, b1, b2 } = self;
        [x * (1.0 + k0 + b1) + b2 * y, y * (1.0 + k0)]
    }
}

impl Bend {
    /// At `u`, with the coefficients `values` and the centre `c`, all of focal length 1.
    #[inline]
    pub(crate) fn at(values: &[f64; COUNT], c: [f64; 2], u: [f64; 2]) -> Self {
        let [k0, k1, k2, k3, p1, p2, b1, b2, t1, t2] = *values;
        let [x, y] = about(c, u);
        let r2 = x * x + y * y;
        let radial = |f: f64| [x * f, y * f];
        let across = [2.0 * x * y, r2 + 2.0 * y * y];
        let along = [r2 + 2.0 * x * x, 2.0 * x * y];
        let lens = [
            radial(r2),
            radial(r2 * r2),
            radial(r2.powi(3)),
            across,
            along,
        ];
        let tilt = [0, 1].map(|i| u.map(|u_j| u_j * u[i]));
        let bent = lens.iter().zip([k1, k2, k3, p1, p2]);
        let all = bent.chain(tilt.iter().zip([t1, t2]));
        let mut v = u;
        for (term, k) in all {
            v[0] += k * term[0];
            v[1] += k * term[1];
        }
        let pixels = Pixels { k0, b1, b2 };
        let end = pixels.read(v);
        Self {
            shift: [end[0] - u[0], end[1] - u[1]],
            bent: v,
            lens,
            tilt,
            pixels,
        }
    }

    /// Slope by the coefficient [`TERMS`]`[k]`.
    #[inline]
    pub(crate) fn slope(&self, k: usize) -> [f64; 2] {
        let [x, y] = self.bent;
        match k {
            0 => [x, y],
            6 => [x, 0.0],
            7 => [y, 0.0],
            8 | 9 => self.pixels.read(self.tilt[k - 8]),
            _ => self.pixels.read(self.lens[k - 1]),
        }
    }
}

/// Tangent-plane position `u` about the axis through `c`.
fn about(c: [f64; 2], u: [f64; 2]) -> [f64; 2] {
    let across = u[0] * c[0] + u[1] * c[1];
    let n = (1.0 + c[0] * c[0] + c[1] * c[1]).sqrt();
    [0, 1].map(|i| (n * u[i] - c[i] - c[i] * across / (1.0 + n)) / (1.0 + across))
}

#[cfg(test)]
mod tests {
    use nalgebra::{UnitQuaternion, Vector3};

    use super::*;

    const STRONG: [f64; COUNT] = [
        0.1, -0.4, 0.25, -0.1, 0.003, -0.004, -0.09, 0.002, 0.02, -0.01,
    ];
    const CENTRE: [f64; 2] = [-0.02, 0.03];
    const PLACES: [[f64; 2]; 5] = [
        [0.0, 0.0],
        [0.5, 0.4],
        [-0.6, 0.3],
        [0.2, -0.5],
        [-0.4, -0.4],
    ];

    /// Central differences over h = 1e-4 err by h^2 / 6 of third derivatives below 10, and by rounding of 1e-16 / h.
    #[test]
    fn slopes_are_derivatives() {
        for u in PLACES {
            let bend = Bend::at(&STRONG, CENTRE, u);
            for k in 0..COUNT {
                let off = |h: f64| {
                    let mut values = STRONG;
                    values[k] += h;
                    Bend::at(&values, CENTRE, u).shift
                };
                let (over, under) = (off(1e-4), off(-1e-4));
                for axis in 0..2 {
                    let slope = (over[axis] - under[axis]) / 2e-4;
                    let error = slope - bend.slope(k)[axis];
                    assert!(error.abs() < 2e-8, "{} at {u:?}: {error}", TERMS[k]);
                }
            }
        }
    }

    /// The axis that pierces the detector off its middle, by a rotation of directions.
    #[test]
    fn a_centre_is_turned_into_the_middle() {
        let axis = |[x, y]: [f64; 2]| Vector3::new(x, y, 1.0);
        let turn = UnitQuaternion::rotation_between(&axis(CENTRE), &Vector3::z()).unwrap();
        for u in PLACES {
            let v = turn * axis(u);
            let [x, y] = about(CENTRE, u);
            assert!((x - v.x / v.z).abs() < 1e-14 && (y - v.y / v.z).abs() < 1e-14);
        }
    }

    /// One after the other: the lens and its tilt, the pixels.
    #[test]
    fn pixels_see_what_the_lens_has_bent() {
        let mut lens = STRONG;
        lens[0] = 0.0;
        lens[6..8].fill(0.0);
        let mut pixels = [0.0; COUNT];
        pixels[0] = STRONG[0];
        pixels[6..8].copy_from_slice(&STRONG[6..8]);
        for u in PLACES {
            let bent = Bend::at(&lens, CENTRE, u).shift;
            let read = Bend::at(&pixels, CENTRE, [u[0] + bent[0], u[1] + bent[1]]).shift;
            let whole = Bend::at(&STRONG, CENTRE, u).shift;
            for axis in 0..2 {
                assert!((whole[axis] - bent[axis] - read[axis]).abs() < 1e-15);
            }
        }
    }

    /// A lens whose axis pierces the detector at c, seen from the middle of the detector: t = -c, to first order.
    #[test]
    fn a_detector_beside_the_axis_is_a_tilt() {
        let c = [1e-4, -2e-4];
        let mut lens = [0.0; COUNT];
        lens[1..4].copy_from_slice(&STRONG[1..4]);
        let mut seen = lens;
        (seen[8], seen[9]) = (-c[0], -c[1]);
        for u in PLACES {
            let w = about(c, u);
            let bent = Bend::at(&lens, [0.0; 2], w).shift;
            let shift = Bend::at(&seen, c, u).shift;
            for axis in 0..2 {
                let truth = c[axis] + w[axis] + bent[axis] - u[axis];
                // of second order in c
                assert!((shift[axis] - truth).abs() < 1e-7);
            }
        }
    }
}
