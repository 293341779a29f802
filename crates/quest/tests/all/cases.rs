//! Random star sets, easy and hard, each from its own stream.

use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

pub(crate) const ARCSEC: f64 = std::f64::consts::PI / 648_000.0;

#[derive(Clone, Debug)]
pub(crate) struct Stars {
    pub(crate) measured: Vec<Vector3<f64>>,
    pub(crate) reference: Vec<Vector3<f64>>,
    pub(crate) weights: Vec<f64>,
}

pub(crate) struct Draw(Xoshiro256PlusPlus);

impl Draw {
    pub(crate) fn new(seed: u64) -> Self {
        Self(Xoshiro256PlusPlus::seed_from_u64(seed))
    }

    pub(crate) fn uniform(&mut self) -> f64 {
        StandardUniform.sample(&mut self.0)
    }

    pub(crate) fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.0)
    }

    pub(crate) fn normals(&mut self) -> Vector3<f64> {
        Vector3::new(self.normal(), self.normal(), self.normal())
    }

    pub(crate) fn one_of<T: Copy>(&mut self, choices: &[T]) -> T {
        let mut left = self.uniform() * choices.len() as f64;
        for &choice in choices {
            left -= 1.0;
            if left < 0.0 {
                return choice;
            }
        }
        choices[0]
    }

    pub(crate) fn attitude(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::new_normalize(Quaternion::new(
            self.normal(),
            self.normal(),
            self.normal(),
            self.normal(),
        ))
    }

    /// Uniform in a disc of the given diameter about Z.
    pub(crate) fn in_field(&mut self, field_deg: f64) -> Vector3<f64> {
        let r = (field_deg / 2.0).to_radians() * self.uniform().sqrt();
        let p = std::f64::consts::TAU * self.uniform();
        Vector3::new(r.sin() * p.cos(), r.sin() * p.sin(), r.cos())
    }

    /// Small rotation of a direction by noise of `sigma` rad per axis.
    pub(crate) fn disturbed(&mut self, v: &Vector3<f64>, sigma: f64) -> Vector3<f64> {
        (v + self.normals() * sigma).normalize()
    }

    /// Any attitude, one within 1..1e-9 rad of 180 degrees, or 180 degrees to the bit.
    fn rotation(&mut self) -> UnitQuaternion<f64> {
        let axis = self.normals().normalize();
        match self.uniform() {
            u if u < 0.5 => self.attitude(),
            u if u < 0.8 => {
                let short = 10_f64.powf(-9.0 * self.uniform());
                let half = 0.5 * short;
                UnitQuaternion::new_normalize(Quaternion::from_parts(half.sin(), axis * half.cos()))
            }
            u if u < 0.9 => UnitQuaternion::new_unchecked(Quaternion::from_parts(0.0, axis)),
            _ => {
                let e = self.one_of(&[Vector3::x(), Vector3::y(), Vector3::z()]);
                UnitQuaternion::new_unchecked(Quaternion::from_parts(0.0, e))
            }
        }
    }

    /// Two to twenty stars in fields of 0.1 to 180 degrees, weights over up to six decades, noise
    /// from none to 1 degree; one case in ten holds unrelated sets, one in forty parallel ones.
    pub(crate) fn stars(&mut self) -> Stars {
        let n = self.one_of(&[2_usize, 2, 3, 3, 4, 6, 8, 14, 20]);
        let field = self.one_of(&[0.1, 0.5, 1.0, 1.0, 2.0, 5.0, 20.0, 20.0, 60.0, 180.0]);
        let decades = self.one_of(&[0.0, 0.0, 1.0, 3.0, 6.0]);
        let sigma = self.one_of(&[0.0, 1.0, 10.0, 100.0, 3600.0]) * ARCSEC;
        let (q, kind) = (self.rotation(), self.uniform());
        let tilt = self.attitude();
        let reference: Vec<_> = (0..n)
            .map(|_| {
                let v = self.in_field(field);
                if kind < 0.025 {
                    tilt * Vector3::z()
                } else {
                    tilt * v
                }
            })
            .collect();
        let measured = reference
            .iter()
            .map(|v| {
                if kind > 0.9 {
                    self.normals().normalize()
                } else {
                    self.disturbed(&(q * v), sigma)
                }
            })
            .collect();
        let weights = (0..n)
            .map(|_| 10_f64.powf(decades * (self.uniform() - 0.5)))
            .collect();
        Stars {
            measured,
            reference,
            weights,
        }
    }
}

/// Profile at unit total weight, by matrices.
pub(crate) fn profile(stars: &Stars) -> Matrix3<f64> {
    let total: f64 = stars.weights.iter().sum();
    let mut b = Matrix3::zeros();
    for ((w, v), a) in stars
        .measured
        .iter()
        .zip(&stars.reference)
        .zip(&stars.weights)
    {
        b += w * v.transpose() * (a / total);
    }
    b
}

/// Davenport: the eigenvector of K, and the gap of its eigenvalues.
pub(crate) fn davenport(b: &Matrix3<f64>) -> (UnitQuaternion<f64>, f64) {
    let s = b.trace();
    let corner = b + b.transpose() - Matrix3::identity() * s;
    let z = Vector3::new(
        b[(2, 1)] - b[(1, 2)],
        b[(0, 2)] - b[(2, 0)],
        b[(1, 0)] - b[(0, 1)],
    );
    let mut k = Matrix4::zeros();
    k.fixed_view_mut::<3, 3>(0, 0).copy_from(&corner);
    k.fixed_view_mut::<3, 1>(0, 3).copy_from(&z);
    k.fixed_view_mut::<1, 3>(3, 0).copy_from(&z.transpose());
    k[(3, 3)] = s;
    let eigen = k.symmetric_eigen();
    let top = eigen.eigenvalues.imax();
    let second = (0..4)
        .filter(|&i| i != top)
        .map(|i| eigen.eigenvalues[i])
        .fold(f64::NEG_INFINITY, f64::max);
    let q = eigen.eigenvectors.column(top);
    (
        UnitQuaternion::new_normalize(Quaternion::new(q[3], q[0], q[1], q[2])),
        eigen.eigenvalues[top] - second,
    )
}

/// Markley: `C = U diag(1, 1, det U det V) V^T`. For `Matrix3` nalgebra's SVD is a closed form
/// through `B^T B`, so this attitude is only good to some `eps/gap^2`.
pub(crate) fn markley(b: &Matrix3<f64>) -> Option<Matrix3<f64>> {
    let svd = b.svd(true, true);
    let (u, vt) = (svd.u?, svd.v_t?);
    let d = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, u.determinant() * vt.determinant()));
    Some(u * d * vt)
}

/// Angle between two attitudes, from the vector part: no cancellation, either sign.
pub(crate) fn angle(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> f64 {
    let d = a * b.inverse();
    2.0 * d.imag().norm().atan2(d.w.abs())
}

/// Angle between an attitude and a rotation matrix: `|C1 - C2| = sqrt(8) sin(angle/2)`.
pub(crate) fn angle_to_matrix(a: &UnitQuaternion<f64>, c: &Matrix3<f64>) -> f64 {
    let chord = (a.to_rotation_matrix().matrix() - c).norm();
    2.0 * (chord / 8_f64.sqrt()).min(1.0).asin()
}
