//! S-curve and spot against SciPy (fixtures/oracles/centroid).

use std::error::Error;
use std::path::Path;

use centroid::{FirstMoment, GaussianPsf, Noise, Window, pixel_gaussian_into};
use focal_plane::Pixel;

type Test = Result<(), Box<dyn Error>>;

fn table<const N: usize>(name: &str) -> Result<Vec<[f64; N]>, Box<dyn Error>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../fixtures/oracles/centroid")
        .join(name);
    let mut rows = Vec::new();
    for record in csv::Reader::from_path(path)?.records() {
        let fields = record?
            .iter()
            .map(str::parse)
            .collect::<Result<Vec<f64>, _>>()?;
        rows.push(<[f64; N]>::try_from(fields).map_err(|row| format!("{name}: {row:?}"))?);
    }
    Ok(rows)
}

/// The quadrature of the narrowest spot (0.15 px, cells of 1/16 px, 16th order) is good to 1e-13.
#[test]
fn s_curve_agrees_with_quadrature() -> Test {
    let rows = table::<4>("s_curve.csv")?;
    assert_eq!(rows.len(), 330);
    for [window, sigma, offset, error] in rows {
        let window = format!("{window}").parse()?;
        let got = GaussianPsf::new(sigma, window)?.error_px(offset);
        assert!(
            (got - error).abs() < 1e-12,
            "{window} {sigma} {offset}: {got} {error}"
        );
    }
    Ok(())
}

/// The first moment of a window filled with the spot has exactly the S-curve's bias.
#[test]
fn first_moment_has_the_bias_of_the_oracle() -> Test {
    let noise = Noise::Detector {
        gain_e: 1.0,
        read_noise_e: 1.0,
        pedestal: 0.0,
    };
    for [side, sigma, offset, error] in table::<4>("s_curve.csv")? {
        let columns: usize = format!("{side}").parse()?;
        let first = Pixel {
            x: 40.5 - 0.5 * (side - 1.0),
            y: -10.5 - 0.5 * (side - 1.0),
        };
        let at = Pixel {
            x: 40.5 + offset,
            y: -10.5 - offset,
        };
        let mut values = vec![0.0; columns * columns];
        pixel_gaussian_into(first, columns, at, sigma, 1e4, &mut values)?;
        let window = Window {
            values: &values,
            columns,
            x0_px: first.x,
            y0_px: first.y,
            background: 0.0,
            background_sigma: 0.0,
            unread: None,
        };
        let star = FirstMoment::default().estimate(&window, &noise)?;
        // rounding of positions near 40 px
        assert!((star.x_px - at.x - error).abs() < 1e-12, "{side} {sigma}");
        assert!((star.y_px - at.y + error).abs() < 1e-12, "{side} {sigma}");
    }
    Ok(())
}

/// `ndtr` subtracts values near one in the far tail: 1e-16 of the flux on each axis.
#[test]
fn spot_agrees_with_scipy() -> Test {
    for (row, [sigma, x, y, column, line, value]) in table::<6>("spot.csv")?.into_iter().enumerate()
    {
        let mut window = [0.0; 36];
        let first = Pixel { x: 0.0, y: 0.0 };
        pixel_gaussian_into(first, 6, Pixel { x, y }, sigma, 1000.0, &mut window)?;
        let at: usize = format!("{}", 6.0 * line + column).parse()?;
        assert!((window[at] - value).abs() < 1e-12, "row {row}");
    }
    Ok(())
}
