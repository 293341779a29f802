//! Every refusal, with the numbers it must carry.

use nalgebra::Vector3;
use quest::{QuestError, covariance, quest};

use crate::cases::Draw;

fn axes() -> [Vector3<f64>; 3] {
    [Vector3::x(), Vector3::y(), Vector3::z()]
}

#[test]
fn lengths_and_numbers_of_stars() {
    let v = axes();
    assert_eq!(
        quest(&v, &v[..2], &[1.0; 3]),
        Err(QuestError::LengthMismatch {
            measured: 3,
            reference: 2,
            weights: 3
        })
    );
    assert!(matches!(
        quest(&v, &v, &[1.0; 4]),
        Err(QuestError::LengthMismatch { weights: 4, .. })
    ));
    assert_eq!(
        quest(&[], &[], &[]),
        Err(QuestError::TooFewStars { got: 0 })
    );
    assert_eq!(
        quest(&v[..1], &v[..1], &[1.0]),
        Err(QuestError::TooFewStars { got: 1 })
    );
    assert_eq!(
        covariance(&v[..1], &[1.0]),
        Err(QuestError::TooFewStars { got: 1 })
    );
}

#[test]
fn components_and_lengths_of_vectors() {
    let good = axes();
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        let mut v = good;
        v[1].z = bad;
        assert_eq!(
            quest(&v, &good, &[1.0; 3]),
            Err(QuestError::NotFinite {
                set: "measured",
                index: 1
            })
        );
        assert_eq!(
            quest(&good, &v, &[1.0; 3]),
            Err(QuestError::NotFinite {
                set: "reference",
                index: 1
            })
        );
    }
    let scaled = |factor: f64| [good[0], good[1], good[2] * factor];
    for factor in [1.0 + 2e-6, 1.0 - 2e-6, 0.0, 3.0] {
        assert_eq!(
            quest(&good, &scaled(factor), &[1.0; 3]),
            Err(QuestError::NotUnit {
                set: "reference",
                index: 2,
                length: factor
            })
        );
    }
}

/// Within the tolerance a length changes nothing: the direction is what counts.
#[test]
fn nearly_unit_vectors_are_scaled() -> Result<(), QuestError> {
    let stars = Draw::new(7).stars();
    let want = quest(&stars.measured, &stars.reference, &stars.weights)?;
    let long: Vec<_> = stars.measured.iter().map(|w| w * (1.0 + 9e-7)).collect();
    let short: Vec<_> = stars.reference.iter().map(|v| v * (1.0 - 4e-7)).collect();
    let got = quest(&long, &short, &stars.weights)?;
    assert!(got.q.angle_to(&want.q) < 40.0 * f64::EPSILON / (want.gap * want.gap));
    assert!((got.lambda - want.lambda).abs() < 1e-12);
    Ok(())
}

#[test]
fn weights() {
    let v = axes();
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let result = quest(&v, &v, &[1.0, bad, 1.0]);
        assert!(
            matches!(
                result,
                Err(QuestError::NotPositive {
                    name: "weight",
                    index: 1,
                    ..
                })
            ),
            "{bad}: {result:?}"
        );
        assert!(covariance(&v, &[1.0, bad, 1.0]).is_err());
    }
    for total in [1e308, 1e-320] {
        let result = quest(&v, &v, &[total; 3]);
        assert!(
            matches!(
                result,
                Err(QuestError::NotPositive {
                    name: "total weight",
                    ..
                })
            ),
            "{result:?}"
        );
    }
    for scale in [1e-290, 1e290] {
        let same = quest(&v, &v, &[scale; 3]).unwrap();
        assert!(same.q.angle() < 1e-15, "{scale}");
    }
}

#[test]
fn parallel_and_antiparallel_sets() {
    let mut draw = Draw::new(3);
    for _ in 0..500 {
        let (u, q) = (draw.normals().normalize(), draw.attitude());
        for signs in [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, 1.0, 1.0]] {
            let line = signs.map(|s| u * s);
            let turned = line.map(|v| q * v);
            let both = quest(&turned, &line, &[1.0, 2.0, 3.0]);
            assert!(matches!(both, Err(QuestError::Parallel { .. })), "{both:?}");
            // only one set parallel: a cluster of matches gone wrong
            let one = quest(&line, &axes(), &[1.0, 2.0, 3.0]);
            assert!(
                matches!(
                    one,
                    Err(QuestError::Parallel {
                        set: "measured",
                        ..
                    })
                ),
                "{one:?}"
            );
            let other = quest(&axes(), &line, &[1.0, 2.0, 3.0]);
            assert!(
                matches!(
                    other,
                    Err(QuestError::Parallel {
                        set: "reference",
                        ..
                    })
                ),
                "{other:?}"
            );
            assert!(matches!(
                covariance(&line, &[1.0; 3]),
                Err(QuestError::Parallel { .. })
            ));
        }
    }
}

/// Mirrored axes fit a half turn about any axis as well as no turn at all.
#[test]
fn mirrored_set_is_degenerate() {
    let v = axes();
    let mirrored = v.map(|v| -v);
    let result = quest(&mirrored, &v, &[1.0; 3]);
    assert!(
        matches!(result, Err(QuestError::Degenerate { gap, .. }) if gap < 1e-15),
        "{result:?}"
    );
}
