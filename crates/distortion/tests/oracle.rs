//! Values, moments and fits against NumPy (fixtures/oracles/distortion).

use std::error::Error;
use std::path::Path;

use distortion::{DistortionField, FieldFit};
use focal_plane::{Normalised, Points};

type Test = Result<(), Box<dyn Error>>;

fn table<const N: usize>(name: &str) -> Result<Vec<[String; N]>, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures/oracles/distortion")
        .join(name);
    let mut rows = Vec::new();
    for record in csv::Reader::from_path(path)?.records() {
        let fields: Vec<String> = record?.iter().map(str::to_owned).collect();
        rows.push(<[String; N]>::try_from(fields).map_err(|row| format!("{name}: {row:?}"))?);
    }
    Ok(rows)
}

fn field(order: usize) -> Result<DistortionField, Box<dyn Error>> {
    let width = order + 1;
    let (mut a, mut b) = (vec![0.0; width * width], vec![0.0; width * width]);
    for [of, power_y, power_x, in_a, in_b] in table::<5>("coefficients.csv")? {
        if of.parse::<usize>()? == order {
            let at = power_y.parse::<usize>()? * width + power_x.parse::<usize>()?;
            (a[at], b[at]) = (in_a.parse()?, in_b.parse()?);
        }
    }
    Ok(DistortionField::from_coefficients(order, &a, &b)?)
}

/// At most 256 terms, each below 4 in size and rounded about 2 * 16 times: 1e-13 in the mean.
#[test]
fn values_agree_with_numpy() -> Test {
    for [order, x, y, f1, f2] in table::<5>("values.csv")? {
        let at = Normalised {
            x: x.parse()?,
            y: y.parse()?,
        };
        let [got1, got2] = field(order.parse()?)?.evaluate(at);
        assert!((got1 - f1.parse::<f64>()?).abs() < 1e-12, "{order} {at:?}");
        assert!((got2 - f2.parse::<f64>()?).abs() < 1e-12, "{order} {at:?}");
    }
    Ok(())
}

/// Quadrature of 40 nodes is exact for these powers: only rounding is left.
#[test]
fn moments_agree_with_quadrature() -> Test {
    for [order, axis, mean, deviation] in table::<4>("moments.csv")? {
        let field = field(order.parse()?)?;
        let axis = usize::from(axis == "y");
        let (mean, deviation) = (mean.parse::<f64>()?, deviation.parse::<f64>()?);
        assert!((field.mean_arcsec()[axis] - mean).abs() < 1e-12);
        assert!((field.deviation_arcsec()[axis] - deviation).abs() < 1e-12);
        assert!((field.rms_arcsec()[axis] - mean.hypot(deviation)).abs() < 1e-12);
    }
    Ok(())
}

/// The design of order 3 has condition number near 30 in monomials: 1e-16 * 30^2, with room.
#[test]
fn fit_agrees_with_numpy() -> Test {
    let rows = table::<5>("fit_rows.csv")?;
    let column = |i: usize| -> Result<Vec<f64>, std::num::ParseFloatError> {
        rows.iter().map(|row| row[i].parse()).collect()
    };
    let [x, y, dx, dy, weight] = [column(0)?, column(1)?, column(2)?, column(3)?, column(4)?];
    let fit = FieldFit::new(
        3,
        Points { x: &x, y: &y },
        Points { x: &dx, y: &dy },
        Some(&weight),
    )?;
    for [power_y, power_x, a, b] in table::<4>("fit_coefficients.csv")? {
        let at = power_y.parse::<usize>()? * 4 + power_x.parse::<usize>()?;
        assert!((fit.field.a()[at] - a.parse::<f64>()?).abs() < 1e-12);
        assert!((fit.field.b()[at] - b.parse::<f64>()?).abs() < 1e-12);
    }
    for [x, y, sigma] in table::<3>("fit_sigma.csv")? {
        let at = Normalised {
            x: x.parse()?,
            y: y.parse()?,
        };
        let [got, _] = fit.sigma_arcsec(at).ok_or("degrees of freedom are left")?;
        assert!((got - sigma.parse::<f64>()?).abs() < 1e-12, "{at:?}");
    }
    Ok(())
}
