//! Against numpy and scipy: densities by filters and quadrature, fits by dense covariance matrices.

use fogm_fit::{
    Convention, FitOptions, Fogm, FogmWhite, LogPsdFit, Method, continuous, expected_periodogram,
    fit_log_psd, fit_psd, fit_series, sampled,
};
use spectra::Psd;

type Failure = Box<dyn std::error::Error>;

fn table(name: &str) -> Result<Vec<Vec<f64>>, Failure> {
    let path = format!(
        "{}/../../fixtures/oracles/fogm-fit/{name}",
        env!("CARGO_MANIFEST_DIR")
    );
    let mut rows = vec![];
    for record in csv::Reader::from_path(path)?.records() {
        let row: Result<Vec<f64>, _> = record?.iter().map(str::parse).collect();
        rows.push(row?);
    }
    Ok(rows)
}

fn close(got: f64, want: f64, tolerance: f64, what: &str) {
    assert!(
        (got / want - 1.0).abs() < tolerance,
        "{what}: {got}, but {want}"
    );
}

/// Closed forms to rounding: the quadrature stops at 1e-12 of the largest value, the sums at 1e-12.
#[test]
fn densities_are_those_of_scipy() -> Result<(), Failure> {
    for row in table("densities.csv")? {
        let process = FogmWhite::new(Fogm::new(row[0], row[1])?, row[2])?;
        let (fs, f) = (row[3], row[5]);
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a count"
        )]
        let n = row[4] as usize;
        close(continuous(process, f, fs), row[6], 1e-7, "continuous");
        close(sampled(process, f, fs), row[7], 1e-9, "sampled");
        close(
            expected_periodogram(process, f, fs, n),
            row[8],
            1e-9,
            "expected",
        );
    }
    Ok(())
}

/// The maximum of the restricted likelihood and the ends of its profiles, with and without holes.
/// scipy stops at 1e-6 in the logarithm, we at 1e-6 of the log-likelihood (2e-3 standard errors, of
/// 0.15), and interpolate interval ends between cuts to a few thousandths.
#[test]
fn series_fits_are_those_of_dense_matrices() -> Result<(), Failure> {
    let series = table("series.csv")?;
    for row in table("fits.csv")? {
        let column = if row[0] < 0.5 { 1 } else { 2 };
        let y: Vec<f64> = series.iter().map(|r| r[column]).collect();
        let fit = fit_series(&y, 1.0, &FitOptions::default())?;
        assert_eq!(fit.method, Method::TimeDomain);
        for i in 0..3 {
            close(fit.maximum[i], row[1 + i], 1e-3, "maximum");
        }
        for (i, estimate) in [fit.sigma_hsf, fit.tau_s, fit.sigma_tn].iter().enumerate() {
            let [low, high] = estimate.interval().ok_or("no interval")?;
            // an open end is none in both
            if row[4 + 2 * i].is_nan() {
                assert!(low == 0.0 && estimate.value().is_none());
            } else {
                close(low, row[4 + 2 * i], 0.01, "low end");
            }
            if high.is_finite() {
                close(high, row[5 + 2 * i], 0.01, "high end");
            }
        }
    }
    Ok(())
}

fn spectrum() -> Result<Psd, Failure> {
    let rows = table("spectrum.csv")?;
    let column = |i: usize| rows.iter().map(|r| r[i]).collect();
    Ok(Psd {
        frequency_hz: column(0),
        psd: column(1),
        dof: column(2),
        fs_hz: 10.0,
    })
}

/// Minimum of Eq. 19, as printed and consistent, with errors from the curvature: the simplex ends
/// where the cost varies by 1e-9, which is 3e-5 of a standard error.
#[test]
fn log_fits_are_those_of_least_squares() -> Result<(), Failure> {
    let (psd, rows) = (spectrum()?, table("spectrum_fits.csv")?);
    let options = FitOptions::default();
    for (row, convention) in rows
        .iter()
        .zip([Convention::AsPrinted, Convention::Consistent])
    {
        let LogPsdFit {
            minimum,
            sigma_hsf,
            tau_s,
            sigma_tn,
            ..
        } = fit_log_psd(&psd, convention, &options)?;
        for (i, estimate) in [sigma_hsf, tau_s, sigma_tn].iter().enumerate() {
            close(minimum[i], row[1 + i], 1e-4, "minimum");
            let sigma = estimate.sigma().ok_or("no error")? / minimum[i];
            close(sigma, row[4 + i], 1e-3, "error");
        }
    }
    let fit = fit_psd(&psd, &options)?;
    for i in 0..3 {
        close(fit.maximum[i], rows[2][1 + i], 2e-4, "Whittle");
    }
    Ok(())
}
