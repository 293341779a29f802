//! The result of a fit in words and numbers.

use std::fmt::Write as _;

use telemetry::report::{AxisFit, FitReport, PreferredModel, WithSigma};

/// A fit as a table of at most 100 columns, with what the data cannot tell below it.
#[must_use]
pub fn fit_summary(report: &FitReport) -> String {
    let mut out = String::new();
    let mut line = |text: String| {
        // writing to a string cannot fail
        let _ = writeln!(out, "{}", text.trim_end());
    };
    if let (Some(rows), Some(span_s), Some(rate_hz)) =
        (&report.rows, report.span_s, report.sample_rate_hz)
    {
        line(format!(
            "Data      {} frames over {span_s:.0} s at {rate_hz:.4} Hz; {} with an outlier, {} outside the reference",
            rows.used, rows.outliers, rows.outside_reference
        ));
        line(String::new());
    }
    let axes = [&report.axes.x, &report.axes.y, &report.axes.z];
    let row = |name: &str, cell: &dyn Fn(&AxisFit) -> String| {
        format!(
            "{name:<30}{}",
            axes.map(|axis| format!("{:>22}", cell(axis))).concat()
        )
    };
    line(format!("{:<30}{:>22}{:>22}{:>22}", "", "X", "Y", "Z"));
    line(row("sigma_HSF, arcsec", &|a| known(&a.sigma_hsf_arcsec)));
    line(row("tau_HSF, s", &|a| known(&a.tau_hsf_s)));
    line(row("sigma_TN, arcsec", &|a| known(&a.sigma_tn_arcsec)));
    line(row("standard deviation, arcsec", &|a| number(a.rms_arcsec)));
    line(row("model that the data ask for", &|a| {
        match a.preferred {
            PreferredModel::FogmWhite => "FOGM + white",
            PreferredModel::White => "white",
            PreferredModel::Fogm => "FOGM",
        }
        .to_owned()
    }));
    line(row("log-PSD cost per dof", &|a| {
        number(Some(a.log_psd_cost))
    }));
    line(row("outliers", &|a| {
        a.outliers.map_or(String::new(), |n| n.to_string())
    }));
    line(String::new());
    line("As printed in [M23] Eq. 17-20, on the raw periodogram:".to_owned());
    line(row("sigma_HSF, arcsec", &|a| {
        number(a.as_printed.sigma_hsf_arcsec)
    }));
    line(row("tau_HSF, s", &|a| number(a.as_printed.tau_hsf_s)));
    line(row("sigma_TN, arcsec", &|a| {
        number(a.as_printed.sigma_tn_arcsec)
    }));
    if !report.notes.is_empty() {
        line(String::new());
        for note in &report.notes {
            line(format!("Note      {note}"));
        }
    }
    out
}

/// Four figures.
fn number(value: Option<f64>) -> String {
    match value {
        None => "-".to_owned(),
        Some(v) if v == 0.0 || !v.is_finite() => format!("{v}"),
        Some(v) => {
            let digits = (3.0 - v.abs().log10().floor()).clamp(0.0, 9.0);
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "0 to 9"
            )]
            let digits = digits as usize;
            format!("{v:.digits$}")
        }
    }
}

fn known(value: &WithSigma) -> String {
    match (value.value, value.sigma, value.interval) {
        (Some(v), Some(s), _) => format!("{} +- {}", number(Some(v)), number(Some(s))),
        (Some(v), None, _) => number(Some(v)),
        (None, _, Some([Some(low), None])) => format!("at least {}", number(Some(low))),
        (None, _, Some([_, Some(high)])) => format!("at most {}", number(Some(high))),
        _ => "not determined".to_owned(),
    }
}
