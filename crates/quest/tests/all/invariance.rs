//! What must not matter: the frame of either set, the order of the stars, both signs, the unit of
//! the weights.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use proptest::prelude::*;
use quest::{MIN_GAP, POLISH_GAP, quest};

use crate::cases::{Draw, Stars, angle};

/// Two solutions of one problem differ by the error of both.
fn bound(gap: f64) -> f64 {
    let eps = f64::EPSILON;
    let one = if gap < POLISH_GAP {
        40.0 * eps / gap
    } else {
        40.0 * eps / (gap * gap)
    };
    2.0 * one + 8.0 * eps
}

fn rotation() -> impl Strategy<Value = UnitQuaternion<f64>> {
    prop::array::uniform4(-1.0..1.0_f64)
        .prop_filter("too short to normalise", |q| {
            q.iter().map(|x| x * x).sum::<f64>() > 0.01
        })
        .prop_map(|[x, y, z, w]| UnitQuaternion::new_normalize(Quaternion::new(w, x, y, z)))
}

/// Star sets that are well off the refusal, where rounding may decide.
fn stars() -> impl Strategy<Value = Stars> {
    (0..1_000_000_u64)
        .prop_map(|seed| Draw::new(seed + 1_000_000).stars())
        .prop_filter("refused", |s| {
            quest(&s.measured, &s.reference, &s.weights).is_ok_and(|s| s.gap > 2.0 * MIN_GAP)
        })
}

fn turned(q: &UnitQuaternion<f64>, set: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    set.iter().map(|v| q * v).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn frames_may_be_turned(s in stars(), p in rotation(), r in rotation()) {
        let plain = quest(&s.measured, &s.reference, &s.weights)?;
        let other = quest(&turned(&p, &s.measured), &turned(&r, &s.reference), &s.weights)?;
        let back = p.inverse() * other.q * r;
        prop_assert!(angle(&back, &plain.q) <= bound(plain.gap));
        prop_assert!((other.gap - plain.gap).abs() < 1e-14);
        // P lives in tracker axes and turns with them
        let m = p.to_rotation_matrix();
        let expected = m.matrix() * plain.covariance * m.matrix().transpose();
        prop_assert!((other.covariance - expected).norm() <= 1e-13 / plain.gap * expected.norm());
    }

    #[test]
    fn order_and_unit_of_weights(s in stars(), shift in 0..20_usize, scale in -200..200_i32) {
        let plain = quest(&s.measured, &s.reference, &s.weights)?;
        let (mut w, mut v, mut a) = (s.measured, s.reference, s.weights);
        let shift = shift % w.len();
        w.rotate_left(shift);
        v.rotate_left(shift);
        a.rotate_left(shift);
        for a in &mut a {
            *a *= 10_f64.powi(scale);
        }
        let other = quest(&w, &v, &a)?;
        prop_assert!(angle(&other.q, &plain.q) <= bound(plain.gap));
    }

    #[test]
    fn a_star_and_its_antipode(s in stars(), which in 0..20_usize) {
        let plain = quest(&s.measured, &s.reference, &s.weights)?;
        let (mut w, mut v) = (s.measured, s.reference);
        let k = which % w.len();
        w[k] = -w[k];
        v[k] = -v[k];
        let other = quest(&w, &v, &s.weights)?;
        prop_assert_eq!(other.q, plain.q);
    }

    #[test]
    fn exchange_inverts(s in stars()) {
        let plain = quest(&s.measured, &s.reference, &s.weights)?;
        let other = quest(&s.reference, &s.measured, &s.weights)?;
        prop_assert!(angle(&other.q.inverse(), &plain.q) <= bound(plain.gap));
        prop_assert!((other.loss - plain.loss).abs() <= 1e-9 * plain.loss + 1e-14 * s.weights.iter().sum::<f64>());
    }
}
