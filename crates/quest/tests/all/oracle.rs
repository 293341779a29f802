//! Recorded answers in 50 digits and from scipy: `fixtures/oracles/quest`.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use quest::{MIN_GAP, POLISH_GAP, QuestError, quest};

use crate::cases::{Stars, angle};

type Row = BTreeMap<String, String>;

fn rows(name: &str) -> Result<Vec<Row>, Box<dyn Error>> {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/oracles/quest");
    let mut reader = csv::Reader::from_path(folder.join(name))?;
    Ok(reader.deserialize().collect::<Result<_, _>>()?)
}

fn number(row: &Row, key: &str) -> Result<f64, Box<dyn Error>> {
    Ok(row.get(key).ok_or(format!("no column {key}"))?.parse()?)
}

fn vector(row: &Row, keys: [&str; 3]) -> Result<Vector3<f64>, Box<dyn Error>> {
    let [x, y, z] = keys;
    Ok(Vector3::new(
        number(row, x)?,
        number(row, y)?,
        number(row, z)?,
    ))
}

fn quaternion(row: &Row, prefix: &str) -> Result<UnitQuaternion<f64>, Box<dyn Error>> {
    let part = |axis: &str| number(row, &format!("{prefix}{axis}"));
    Ok(UnitQuaternion::new_unchecked(Quaternion::new(
        part("qw")?,
        part("qx")?,
        part("qy")?,
        part("qz")?,
    )))
}

/// Within 40 eps/gap of the exact answer (40 eps/gap^2 unpolished); a refusal exactly below
/// `MIN_GAP`. The quaternion's own rounding adds 2 eps.
#[test]
fn exact_and_scipy_solutions() -> Result<(), Box<dyn Error>> {
    let mut sets: BTreeMap<String, Stars> = BTreeMap::new();
    for row in rows("stars.csv")? {
        let stars = sets.entry(row["case"].clone()).or_insert(Stars {
            measured: vec![],
            reference: vec![],
            weights: vec![],
        });
        stars.measured.push(vector(&row, ["wx", "wy", "wz"])?);
        stars.reference.push(vector(&row, ["vx", "vy", "vz"])?);
        stars.weights.push(number(&row, "weight")?);
    }
    let (mut solved, mut refused) = (0, 0);
    for row in rows("solutions.csv")? {
        let (name, gap) = (&row["case"], number(&row, "gap")?);
        let Stars {
            measured,
            reference,
            weights,
        } = &sets[name];
        let got = match quest(measured, reference, weights) {
            Ok(got) => got,
            Err(QuestError::Parallel { .. } | QuestError::Degenerate { .. }) if gap < MIN_GAP => {
                refused += 1;
                continue;
            }
            Err(error) => return Err(format!("{name}: {error}, gap {gap:e}").into()),
        };
        assert!(gap >= MIN_GAP, "{name}: solved at gap {gap:e}");
        let eps = f64::EPSILON;
        let bound = 2.0 * eps
            + if gap < POLISH_GAP {
                40.0 * eps / gap
            } else {
                40.0 * eps / (gap * gap)
            };
        let error = angle(&got.q, &quaternion(&row, "")?);
        assert!(error <= bound, "{name}: {error:e} rad, bound {bound:e}");
        let scipy = number(&row, "scipy_error_rad")?;
        let apart = angle(&got.q, &quaternion(&row, "scipy_")?);
        assert!(
            apart <= bound + scipy + 4.0 * eps,
            "{name}: {apart:e} rad from scipy"
        );
        assert!(
            (got.gap - gap).abs() < 20.0 * eps,
            "{name}: gap {} not {gap}",
            got.gap
        );
        // the quartic's root is good to eps over its slope, which is 4 gap in a narrow field
        let lambda = number(&row, "lambda")?;
        assert!(
            (got.lambda - lambda).abs() < 10.0 * eps + 4.0 * eps / gap,
            "{name}: lambda"
        );
        // [M23] Eq. 12 and the eigenvalue say the same; the root again limits it
        let total: f64 = weights.iter().sum();
        let loss = 2.0 * total * (1.0 - lambda);
        assert!(
            (got.loss - loss).abs() < 20.0 * eps * total,
            "{name}: loss {} not {loss}",
            got.loss
        );
        solved += 1;
    }
    assert_eq!((solved, refused), (97, 3));
    Ok(())
}
