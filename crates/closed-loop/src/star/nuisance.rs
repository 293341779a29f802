//! What the declared model leaves unknown, as columns with priors.
//!
//! ```text
//! misalignment   dx = J(P) theta                    three angles, prior: declared bias, or free;
//!                                                   P is projected through theta itself
//! distortion     dx = sum_jk a_jk (x^j y^k - m_jk)  (j,k) != (0,0), m_jk the mean over the field,
//!                                                   the same for y; prior N(0, s^2) each
//! zeros          dx = e, dy = n                     two numbers a star, of centroids formed anew
//! directions     dx = f/Z-projection of q (e a + n b)   two angles a star, prior: a pixel
//! ```
//!
//! The distortion's draw is N(0,1) scaled to `sigma_LSF`, so the spread of its
//! coefficients differs from draw to draw by 0.58 to 2.2 times (1 to 99 %): the
//! prior is widened by that 2.2, or everything constant per star raises alarms
//! when the stars hardly move.
//!
//! Source: [M23] Eq. 5-8 and Section 2.3.

use std::ops::Range;

use distortion::{DistortionField, monomial_moment};
use focal_plane::Pixel;
use nalgebra::{DVector, Vector3};
use telemetry::Model;

use crate::star::columns::Filled;
use crate::star::data::StarData;

/// 99 % point of the ratio between the spread of one draw's coefficients and
/// the spread over all draws.
const PRIOR_WIDENING: f64 = 2.2;

/// The unknowns of the declared model at star level.
#[derive(Clone, Debug)]
pub(crate) struct StarNuisance {
    /// 1 sigma of each misalignment angle, arcsec; infinite = free. `None`:
    /// absorbed by the free attitude of each frame.
    misalignment: Option<[f64; 3]>,
    /// Order of the distortion polynomials and 1 sigma of a coefficient, arcsec.
    distortion: Option<(usize, f64)>,
    /// Stars whose direction is unknown: all or none.
    directions: usize,
    /// 1 sigma of what the solved directions are off by, arcsec: a pixel. With free
    /// attitudes some patterns of directions are rotations but for their second
    /// order; without a bound they run away by tens of pixels on noise alone.
    direction_sigma: f64,
    /// 1 sigma of what is constant for each star, arcsec; empty for the centroids of the table.
    zeros: Vec<[f64; 2]>,
    moments: Vec<f64>,
}

/// 1 sigma of a zero that is as good as known, arcsec.
const LEAST_ZERO: f64 = 1e-4;

impl StarNuisance {
    /// What `model` declares unknown for `data`.
    pub(crate) fn declared(model: &Model, data: &StarData) -> Self {
        let noise = &model.noise;
        let order = noise.distortion_order.unwrap_or(7) as usize;
        let circular = noise.distortion_arcsec.unwrap_or(0.0);
        let moments = moments(order);
        let distortion = (circular > 0.0 && order > 0)
            .then(|| (order, PRIOR_WIDENING * coefficient_sigma(order, circular)));
        Self {
            misalignment: (!data.free_attitude).then(|| {
                noise.bias_arcsec.map_or([f64::INFINITY; 3], |b| {
                    b.map(|sigma| if sigma > 0.0 { sigma } else { f64::INFINITY })
                })
            }),
            distortion,
            directions: if data.free_directions {
                data.stars.len()
            } else {
                0
            },
            direction_sigma: data.camera.arcsec_per_px()[0],
            zeros: Vec::new(),
            moments,
        }
    }

    /// The same where what is constant for each star is known to these 1 sigma alone, px; where directions
    /// are unknown they hold it already.
    pub(crate) fn with_zeros(mut self, data: &StarData, sigma_px: &[[f64; 2]]) -> Self {
        if self.directions == 0 {
            let scale = data.camera.arcsec_per_px();
            let arcsec = |s: &[f64; 2]| [0, 1].map(|a| (s[a] * scale[a]).max(LEAST_ZERO));
            self.zeros = sigma_px.iter().map(arcsec).collect();
        }
        self
    }

    /// Prior precision of each column's amplitude, 1/arcsec^2.
    pub(crate) fn precision(&self) -> Vec<f64> {
        let mut precision = Vec::new();
        if let Some(sigma) = self.misalignment {
            precision.extend(sigma.map(|s| if s.is_finite() { 1.0 / (s * s) } else { 0.0 }));
        }
        if let Some((_, sigma)) = self.distortion {
            precision.extend(std::iter::repeat_n(
                1.0 / (sigma * sigma),
                2 * (self.moments.len() - 1),
            ));
        }
        let direction = 1.0 / (self.direction_sigma * self.direction_sigma);
        precision.extend(std::iter::repeat_n(direction, 2 * self.directions));
        precision.extend(self.zeros.as_flattened().iter().map(|s| 1.0 / (s * s)));
        precision
    }

    /// Columns of the misalignment, polynomials of an axis, columns of the directions or zeros.
    pub(crate) fn parts(&self) -> (usize, usize, usize) {
        (
            3 * usize::from(self.misalignment.is_some()),
            self.distortion.map_or(0, |_| self.moments.len() - 1),
            2 * self.directions + 2 * self.zeros.len(),
        )
    }

    /// The misalignment among the amplitudes of the columns, arcsec.
    pub(crate) fn misalignment_of(&self, amplitudes: &DVector<f64>) -> Option<Vector3<f64>> {
        self.misalignment?;
        Some(amplitudes.fixed_rows::<3>(0).into_owned())
    }

    /// Writes the entries of the rows of `frames`, arcsec per arcsec, into zeros.
    pub(crate) fn fill(&self, data: &StarData, frames: Range<usize>, out: &mut Filled) {
        let first = data.frames.first_row[frames.start];
        let scale = data.camera.arcsec_per_px();
        let per_rad = scale.map(|s| s / focal_plane::ARCSEC_PER_RAD);
        let (misalignment, _, _) = self.parts();
        let mut basis = vec![0.0; self.moments.len()];
        for frame in frames {
            for row in data.frames.rows_of(frame) {
                let i = row - first;
                let at = Pixel {
                    x: data.modelled[0][row],
                    y: data.modelled[1][row],
                };
                if misalignment > 0 {
                    let jacobian = data.camera.rotation_jacobian(at);
                    for axis in 0..2 {
                        for k in 0..3 {
                            out.own[axis][(i, k)] = jacobian[axis][k] * per_rad[axis];
                        }
                    }
                }
                if let Some((order, _)) = self.distortion {
                    DistortionField::basis_into(order, data.camera.normalised(at), &mut basis);
                    let count = basis.len() - 1;
                    let polynomials = &mut out.shared.as_mut_slice()[i * count..(i + 1) * count];
                    let basis = basis[1..].iter().zip(&self.moments[1..]);
                    for (out, (value, mean)) in polynomials.iter_mut().zip(basis) {
                        *out = value - mean;
                    }
                }
                if self.directions > 0 {
                    let u = data.stars[data.star[row]].direction;
                    let q = &data.attitude[frame];
                    let v = q * u;
                    for (k, across) in tangent_axes(&u).into_iter().enumerate() {
                        let d = q * across;
                        let column = misalignment + 2 * data.star[row] + k;
                        // derivative of (X/Z, Y/Z)
                        out.own[0][(i, column)] = (d.x - v.x / v.z * d.z) / v.z;
                        out.own[1][(i, column)] = (d.y - v.y / v.z * d.z) / v.z;
                    }
                }
                // never beside directions
                if !self.zeros.is_empty() {
                    for axis in 0..2 {
                        out.own[axis][(i, misalignment + 2 * data.star[row] + axis)] = 1.0;
                    }
                }
            }
        }
    }
}

/// Two unit vectors across `u`; any pair serves, the amplitudes are never read.
fn tangent_axes(u: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let seed = if u.z.abs() < 0.9 {
        Vector3::z()
    } else {
        Vector3::x()
    };
    let east = seed.cross(u).normalize();
    [east, u.cross(&east)]
}

/// Mean of every monomial over the field, in the order of the basis.
fn moments(order: usize) -> Vec<f64> {
    let mut out = Vec::with_capacity((order + 1) * (order + 1));
    for k in 0..=order {
        for j in 0..=order {
            out.push(monomial_moment(j, k));
        }
    }
    out
}

/// 1 sigma of a coefficient such that the expected per-axis variance over the
/// field is `sigma_LSF^2 / 2`: `sum_jk s^2 (m_2j,2k - m_jk^2) = sigma_LSF^2 / 2`.
fn coefficient_sigma(order: usize, circular_arcsec: f64) -> f64 {
    let mut variance = 0.0;
    for k in 0..=order {
        for j in 0..=order {
            let mean = monomial_moment(j, k);
            variance += monomial_moment(2 * j, 2 * k) - mean * mean;
        }
    }
    circular_arcsec / (2.0 * variance).sqrt()
}
