//! Against scipy, numpy, allantools and mpmath, on recorded series.
//!
//! Rounding: a transform of N samples errs by about `eps log2 N` of the rms of its output, so that
//! densities agree to `1e-13` of the largest one; a deviation through sums of N terms to `1e-12`.
use std::error::Error;

use spectra::{
    Allan, AllanData, AllanKind, Detrend, LombScargle, LombScargleSettings, Multitaper,
    MultitaperSettings, PowerLaw, Slepian, TaperWeights, Welch, WelchSettings, Window,
    chi_squared_quantile, log_bias, log_variance, mean_rate_hz, periodogram, whole,
};

use crate::cases::{Row, Table, close};

const FS_HZ: f64 = 8.0;

type Outcome = Result<(), Box<dyn Error>>;

fn window(name: &str) -> Result<Window, Box<dyn Error>> {
    Ok(match name {
        "boxcar" => Window::Boxcar,
        "hann" => Window::Hann,
        "hamming" => Window::Hamming,
        "blackman" => Window::Blackman,
        "blackmanharris" => Window::BlackmanHarris,
        "nuttall" => Window::Nuttall,
        "flattop" => Window::FlatTop,
        _ => return Err(name.into()),
    })
}

fn detrend(name: &str) -> Result<Detrend, Box<dyn Error>> {
    Ok(match name {
        "none" => Detrend::None,
        "constant" => Detrend::Constant,
        "linear" => Detrend::Linear,
        _ => return Err(name.into()),
    })
}

fn largest(values: &[f64]) -> f64 {
    values.iter().fold(0.0, |m, v| v.max(m))
}

#[test]
fn welch_csd_and_coherence_of_scipy() -> Outcome {
    let series = Table::read("series.csv")?;
    let (x, y) = (series.column("x")?, series.column("y")?);
    let mut checked = 0;
    for row in Table::read("welch.csv")?.rows() {
        let welch = Welch::new(WelchSettings {
            segment: row.count("segment")?,
            overlap: row.count("overlap")?,
            window: window(row.text("window")?)?,
            detrend: detrend(row.text("detrend")?)?,
            fs_hz: FS_HZ,
        })?;
        let k = row.count("bin")?;
        let cross = welch.process_cross(&x, &y, &whole(&x))?;
        let alone = welch.process(&x)?;
        let scale = largest(&cross.xx);
        close(
            cross.frequency_hz[k],
            row.number("frequency_hz")?,
            1.0,
            1e-14,
            row,
        );
        close(cross.xx[k], row.number("xx")?, scale, 1e-13, row);
        close(alone.psd[k], cross.xx[k], scale, 1e-15, row);
        let cross_scale = (scale * largest(&cross.yy)).sqrt();
        close(
            cross.xy[k].re,
            row.number("xy_re")?,
            cross_scale,
            1e-13,
            row,
        );
        close(
            cross.xy[k].im,
            row.number("xy_im")?,
            cross_scale,
            1e-13,
            row,
        );
        // a bin that the trend has emptied holds rounding alone
        if cross.xx[k] > 1e-12 * scale {
            let amplified = scale / cross.xx[k].min(cross.yy[k]);
            close(
                cross.coherence()[k],
                row.number("coherence")?,
                amplified,
                1e-13,
                row,
            );
            checked += 1;
        }
    }
    assert!(checked > 100, "{checked} rows compared");
    Ok(())
}

#[test]
fn periodogram_of_scipy() -> Outcome {
    let x = Table::read("series.csv")?.column("x")?;
    for row in Table::read("periodogram.csv")?.rows() {
        let got = periodogram(
            &x[..row.count("samples")?],
            FS_HZ,
            window(row.text("window")?)?,
            detrend(row.text("detrend")?)?,
        )?;
        let k = row.count("bin")?;
        close(
            got.frequency_hz[k],
            row.number("frequency_hz")?,
            1.0,
            1e-14,
            row,
        );
        close(
            got.psd[k],
            row.number("psd")?,
            largest(&got.psd),
            1e-13,
            row,
        );
    }
    Ok(())
}

#[test]
fn tapers_of_scipy() -> Outcome {
    for row in Table::read("dpss.csv")?.rows() {
        let slepian = Slepian::new(
            row.count("samples")?,
            row.number("nw")?,
            row.count("tapers")?,
        )?;
        let k = row.count("taper")?;
        let value = slepian.taper(k)[row.count("sample")?];
        // both err by eps ||T|| / gap, about 1e-13 at these lengths
        close(value, row.number("value")?, 1.0, 2e-13, row);
        close(
            slepian.concentration()[k],
            row.number("concentration")?,
            1.0,
            1e-13,
            row,
        );
    }
    Ok(())
}

fn multitaper_of(row: Row<'_>, weights: TaperWeights) -> Result<Multitaper, Box<dyn Error>> {
    Ok(Multitaper::new(MultitaperSettings {
        samples: row.count("samples")?,
        time_half_bandwidth: row.number("nw")?,
        tapers: row.count("tapers")?,
        transform: row.count("transform")?,
        detrend: Detrend::Constant,
        weights,
        fs_hz: FS_HZ,
    })?)
}

#[test]
fn multitaper_and_f_test_of_numpy() -> Outcome {
    let x = Table::read("series.csv")?.column("x")?;
    for row in Table::read("multitaper.csv")?.rows() {
        let k = row.count("bin")?;
        let weights = [
            ("uniform", TaperWeights::Uniform),
            ("eigenvalue", TaperWeights::Eigenvalue),
            ("adaptive", TaperWeights::Adaptive),
        ];
        for (name, weights) in weights {
            let plan = multitaper_of(row, weights)?;
            let samples = &x[..plan.settings().samples];
            let got = plan.process(samples)?;
            // tapers err by 1e-13; the fixed point of the adaptive weights by 1e-11 where lambda is small
            close(got.psd[k], row.number(name)?, got.psd[k], 1e-9, (name, row));
            if weights == TaperWeights::Adaptive {
                close(got.dof[k], row.number("dof")?, got.dof[k], 1e-9, row);
                let (mut f, mut c) = (
                    vec![0.0; plan.bins()],
                    vec![Default::default(); plan.bins()],
                );
                plan.f_test_into(samples, &mut plan.make_scratch(), &mut f, &mut c)?;
                close(f[k], row.number("f")?, 1.0 + f[k], 1e-8, row);
                close(c[k].re, row.number("c_re")?, c[k].norm(), 1e-9, row);
                close(c[k].im, row.number("c_im")?, c[k].norm(), 1e-9, row);
            }
        }
    }
    Ok(())
}

#[test]
fn lomb_scargle_of_scipy() -> Outcome {
    let series = Table::read("series.csv")?;
    let (x, t_s) = (series.column("x")?, series.column("t_s")?);
    let plan = |floating_mean| {
        LombScargle::new(
            &t_s,
            LombScargleSettings {
                first_hz: 0.02,
                step_hz: 0.01,
                bins: 300,
                floating_mean,
                fs_hz: mean_rate_hz(&t_s)?,
            },
        )?
        .process(&x)
    };
    let (plain, floating) = (plan(false)?, plan(true)?);
    let scale = largest(&plain.psd);
    for row in Table::read("lomb_scargle.csv")?.rows() {
        let k = row.count("bin")?;
        close(plain.psd[k], row.number("plain")?, scale, 1e-12, row);
        close(floating.psd[k], row.number("floating")?, scale, 1e-12, row);
    }
    Ok(())
}

fn kind(name: &str) -> AllanKind {
    if name == "classic" {
        AllanKind::Classic
    } else {
        AllanKind::Overlapping
    }
}

#[test]
fn allan_deviations_of_allantools() -> Outcome {
    let x = Table::read("series.csv")?.column("x")?;
    for row in Table::read("allan.csv")?.rows() {
        let data = match row.text("data")? {
            "angle" => AllanData::Angle,
            _ => AllanData::Rate,
        };
        let allan = Allan::new(data, kind(row.text("kind")?), PowerLaw::WhiteRate, FS_HZ)?;
        let got = allan.process(&x, &[row.count("factor")?])?;
        let expected = row.number("deviation")?;
        close(got.deviation[0], expected, expected, 1e-12, row);
        assert_eq!(got.differences[0], row.count("differences")?, "{row:?}");
    }
    Ok(())
}

/// White noise of the angle agrees to rounding, and so do the three continuous laws where allantools takes
/// the limit of many samples too (`m > 33`, up to 100 terms). Beyond, it extrapolates, to 4e-4 (white and random
/// walk) or 2e-2 (flicker); where it averages the angle over few samples the two differ by definition, and
/// `allan.rs` simulates.
#[test]
fn allan_degrees_of_freedom_of_allantools() -> Outcome {
    let laws = [
        PowerLaw::RandomWalkRate,
        PowerLaw::FlickerRate,
        PowerLaw::WhiteRate,
        PowerLaw::FlickerAngle,
        PowerLaw::WhiteAngle,
    ];
    let mut compared = 0;
    for row in Table::read("allan_edf.csv")?.rows() {
        let alpha: i32 = row.text("alpha")?.parse()?;
        let law = laws[usize::try_from(alpha + 2)?];
        let (m, classic) = (row.count("factor")?, row.text("kind")? == "classic");
        let tolerance = match law {
            PowerLaw::WhiteAngle => 1e-12,
            PowerLaw::FlickerAngle if classic || m < 33 => 1e-3,
            PowerLaw::FlickerAngle => 2e-2,
            _ if m <= 33 => continue,
            PowerLaw::FlickerRate => 5e-3,
            _ if classic => 1e-12,
            _ => 1e-3,
        };
        let got = spectra::allan_edf(law, kind(row.text("kind")?), m, row.count("angles")?);
        let expected = row.number("edf")?;
        close(got, expected, expected, tolerance, row);
        compared += 1;
    }
    assert_eq!(compared, 42);
    Ok(())
}

#[test]
fn functions_of_mpmath_and_scipy() -> Outcome {
    for row in Table::read("log_chi.csv")?.rows() {
        let dof = row.number("dof")?;
        let (bias, variance) = (row.number("bias")?, row.number("variance")?);
        close(log_bias(dof), bias, bias.abs(), 1e-14, row);
        close(log_variance(dof), variance, variance, 4e-15, row);
    }
    for row in Table::read("chi_squared.csv")?.rows() {
        let got = chi_squared_quantile(row.number("probability")?, row.number("dof")?)?;
        let expected = row.number("quantile")?;
        let tolerance = if row.number("dof")? > 1e5 {
            1e-9
        } else {
            1e-11
        };
        close(got, expected, expected, tolerance, row);
    }
    Ok(())
}
