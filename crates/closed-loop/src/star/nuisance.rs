//! What the declared model leaves unknown, as columns with priors.
//!
//! ```text
//! misalignment   dx = J(P) theta                    three angles, prior: declared bias, or free;
//!                                                   P is projected through theta itself, and
//!                                                   unknown directions turn with it
//! distortion     dx = sum_jk a_jk (x^j y^k - m_jk)  (j,k) != (0,0), m_jk the mean over the field,
//!                                                   the same for y; prior: that of a draw
//! zeros          dx = e, dy = n                     two numbers a star, of centroids formed anew
//! directions     dx = f/Z-projection of q (e a + n b)   two angles a star, prior: a pixel
//! ```
//!
//! The distortion's draw is N(0,1) scaled to `sigma_LSF`, so the spread of its
//! coefficients differs from draw to draw by 0.58 to 2.2 times (1 to 99 %): each of
//! its modes has a prior that covers this ([`coefficient_precision`]), or everything constant per
//! star raises alarms when the stars hardly move.
//!
//! Source: [M23] Eq. 5-8 and Section 2.3.

use std::ops::Range;

use distortion::{DistortionField, LsfSigma, coefficient_precision, monomial_moment};
use focal_plane::{Angle, Pixel};
use nalgebra::{DMatrix, DVector, Vector3};
use telemetry::Model;

use crate::star::data::StarData;
use crate::star::layout::{Filled, shared_at};

/// The unknowns of the declared model at star level.
#[derive(Clone, Debug)]
pub(crate) struct StarNuisance {
    /// 1 sigma of each misalignment angle, arcsec; infinite = free. `None`:
    /// absorbed by the free attitude of each frame.
    misalignment: Option<[f64; 3]>,
    /// Order of the distortion polynomials, and the prior precision of the coefficients of an axis, 1/arcsec^2.
    distortion: Option<(usize, DMatrix<f64>)>,
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

/// 1 sigma of a misalignment that nobody declared where directions are unknown, arcsec: a degree. A tracker that
/// hardly turns tells nothing of it.
const UNKNOWN_MOUNT: f64 = 3600.0;
/// 1 sigma of a zero that is as good as known, arcsec.
const LEAST_ZERO: f64 = 1e-4;

impl StarNuisance {
    /// What `model` declares unknown for `data`.
    pub(crate) fn declared(model: &Model, data: &StarData) -> Self {
        let noise = &model.noise;
        let order = noise.distortion_order.unwrap_or(7) as usize;
        let declared = Angle::from_arcsec(noise.distortion_arcsec.unwrap_or(0.0));
        let per_axis = LsfSigma::Circular(declared).per_axis().arcsec();
        let moments = moments(order);
        let distortion = (per_axis > 0.0 && order > 0)
            .then(|| (order, coefficient_precision(order) / per_axis.powi(2)));
        let unknowns = Self {
            misalignment: (!data.free_attitude).then(|| {
                let unknown = if data.free_directions {
                    UNKNOWN_MOUNT
                } else {
                    f64::INFINITY
                };
                noise.bias_arcsec.map_or([unknown; 3], |b| {
                    b.map(|sigma| if sigma > 0.0 { sigma } else { unknown })
                })
            }),
            distortion,
            directions: 0,
            direction_sigma: data.camera.arcsec_per_px()[0],
            zeros: Vec::new(),
            moments,
        };
        unknowns.of_stars(data)
    }

    /// The same unknowns of the stars of other data.
    pub(crate) fn of_stars(self, data: &StarData) -> Self {
        Self {
            directions: if data.free_directions {
                data.stars.len()
            } else {
                0
            },
            ..self
        }
    }

    /// No unknowns at all.
    pub(crate) fn none() -> Self {
        Self {
            misalignment: None,
            distortion: None,
            directions: 0,
            direction_sigma: f64::INFINITY,
            zeros: Vec::new(),
            moments: Vec::new(),
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

    /// Prior precision of the columns' amplitudes, 1/arcsec^2.
    pub(crate) fn precision(&self) -> DMatrix<f64> {
        let (misaligned, polynomials, stars) = self.parts();
        let columns = misaligned + 2 * polynomials + stars;
        let mut out = DMatrix::zeros(columns, columns);
        for (k, sigma) in self.misalignment.iter().flatten().enumerate() {
            out[(k, k)] = sigma.powi(-2);
        }
        if let Some((_, precision)) = &self.distortion {
            for axis in 0..2 {
                let at = |k| shared_at(misaligned, k, axis);
                for k in 0..polynomials {
                    (0..polynomials).for_each(|j| out[(at(j), at(k))] = precision[(j, k)]);
                }
            }
        }
        let directions = std::iter::repeat_n(self.direction_sigma, 2 * self.directions);
        let of_stars = directions.chain(self.zeros.as_flattened().iter().copied());
        for (k, sigma) in (misaligned + 2 * polynomials..).zip(of_stars) {
            out[(k, k)] = sigma.powi(-2);
        }
        out
    }

    /// Columns of the misalignment, polynomials of an axis, columns of the directions or zeros.
    pub(crate) fn parts(&self) -> (usize, usize, usize) {
        (
            3 * usize::from(self.misalignment.is_some()),
            self.distortion
                .as_ref()
                .map_or(0, |_| self.moments.len() - 1),
            2 * self.directions + 2 * self.zeros.len(),
        )
    }

    /// Prior precision of the distortion's coefficients of an axis, 1/arcsec^2.
    pub(crate) fn distortion_precision(&self) -> Option<&DMatrix<f64>> {
        self.distortion.as_ref().map(|(_, precision)| precision)
    }

    /// Columns of the distortion: those of x, then those of y.
    pub(crate) fn distorted(&self) -> Vec<usize> {
        let (misalignment, polynomials, _) = self.parts();
        let of_axis = |axis| (0..polynomials).map(move |k| shared_at(misalignment, k, axis));
        (0..2).flat_map(of_axis).collect()
    }

    /// Columns of unknown directions.
    pub(crate) fn directions(&self) -> Range<usize> {
        let (misalignment, polynomials, _) = self.parts();
        let first = misalignment + 2 * polynomials;
        first..first + 2 * self.directions
    }

    /// The misalignment among the amplitudes of the columns, arcsec.
    pub(crate) fn misalignment_of(&self, amplitudes: &DVector<f64>) -> Option<Vector3<f64>> {
        self.misalignment?;
        Some(amplitudes.fixed_rows::<3>(0).into_owned())
    }

    /// Writes what the distortion's coefficients of an axis do to a row, each less its mean over the field; `basis` is
    /// scratch for a number more.
    fn polynomials_into(&self, data: &StarData, row: usize, basis: &mut [f64], out: &mut [f64]) {
        let Some((order, _)) = &self.distortion else {
            return;
        };
        let at = Pixel {
            x: data.modelled[0][row],
            y: data.modelled[1][row],
        };
        DistortionField::basis_into(*order, data.camera.normalised(at), basis);
        let basis = basis[1..].iter().zip(&self.moments[1..]);
        for (out, (value, mean)) in out.iter_mut().zip(basis) {
            *out = value - mean;
        }
    }

    /// What the distortion does to each row, columns by rows.
    pub(crate) fn polynomials(&self, data: &StarData, rows: Range<usize>) -> DMatrix<f64> {
        let (_, count, _) = self.parts();
        let mut out = DMatrix::zeros(count, rows.len());
        let mut basis = vec![0.0; self.moments.len()];
        for (row, mut own) in rows.zip(out.column_iter_mut()) {
            self.polynomials_into(data, row, &mut basis, own.as_mut_slice());
        }
        out
    }

    /// Writes the entries of the rows of `frames`, arcsec per arcsec, into zeros.
    pub(crate) fn fill(&self, data: &StarData, frames: Range<usize>, out: &mut Filled) {
        let first = data.frames.first_row[frames.start];
        let (misalignment, _, _) = self.parts();
        let mut basis = vec![0.0; self.moments.len()];
        for frame in frames {
            for row in data.frames.rows_of(frame) {
                let i = row - first;
                if misalignment > 0 {
                    let turned = data.misalignment_row(row, frame);
                    for axis in 0..2 {
                        for k in 0..3 {
                            out.own[axis][(i, k)] = turned[axis][k];
                        }
                    }
                }
                let polynomials = out.shared.nrows();
                let own = &mut out.shared.as_mut_slice()[i * polynomials..(i + 1) * polynomials];
                self.polynomials_into(data, row, &mut basis, own);
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

/// Two unit vectors across `u`, along which a direction is moved; any pair serves.
pub(super) fn tangent_axes(u: &Vector3<f64>) -> [Vector3<f64>; 2] {
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

#[cfg(test)]
mod tests {
    use focal_plane::{Camera, StarFrames};

    use super::*;
    use crate::star::harness::seen;

    /// What a draw of the prior does to stars all over the field: on each axis the declared variance, wider by what
    /// normalised draws of few modes have beyond a Gaussian (`coefficient_precision`), and nothing of x with y.
    /// On a grid the mean over the field is short by the polynomials' steepness at the edges, 1 %.
    #[test]
    fn the_distortion_of_stars_has_the_declared_prior() {
        let camera = Camera::from_focal_length_px([1024; 2], 3000.0).unwrap();
        let side = 30;
        let place = |k: usize| 1024.0 * ((k as f64 + 0.5) / side as f64 - 0.5);
        let places: Vec<[f64; 2]> = (0..side * side)
            .map(|star| [place(star % side), place(star / side)])
            .collect();
        let mut frames = StarFrames::new();
        frames.begin(0.0);
        for (id, [x, y]) in (0..).zip(&places) {
            frames.push(0, id, *x, *y);
        }
        let data = seen(&camera, &frames, None, &places);
        let mut model = Model::default();
        model.noise.distortion_arcsec = Some(3.0);
        model.noise.distortion_order = Some(7);
        let nuisance = StarNuisance::declared(&model, &data);
        let polynomials = nuisance.polynomials(&data, 0..data.t_s.len());
        let precision = nuisance.precision();
        let columns = [0, 1].map(|axis| {
            let mut out = DMatrix::zeros(data.t_s.len(), precision.nrows());
            for (row, values) in polynomials.column_iter().enumerate() {
                for (k, value) in values.iter().enumerate() {
                    out[(row, shared_at(0, k, axis))] = *value;
                }
            }
            out
        });
        let [x, y] = columns;
        let covariance = precision.try_inverse().unwrap();
        let of_x = &x * &covariance;
        let mean = (&of_x * x.transpose()).trace() / data.t_s.len() as f64;
        let declared = 3.0_f64.powi(2) / 2.0;
        assert!((0.99..1.2).contains(&(mean / declared)), "{mean}");
        assert!((of_x * y.transpose()).amax() < 1e-9 * declared);
    }
}
