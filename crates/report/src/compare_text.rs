//! A comparison in words and numbers.

use std::fmt::Write as _;

use telemetry::report::{CompareReport, ComparedAxis, ComparedBand, ComparedModel, StarSource};

/// A comparison as tables of at most 100 columns.
#[must_use]
pub fn compare_summary(report: &CompareReport) -> String {
    let mut out = String::new();
    let [x, y, z] = report.measured_std_arcsec;
    let rows = &report.rows;
    // writing to a string cannot fail
    let _ = writeln!(
        out,
        "Data      {} frames over {:.0} s at {:.4} Hz; {} with an outlier, {} outside the reference",
        rows.used, report.span_s, report.sample_rate_hz, rows.outliers, rows.outside_reference
    );
    let _ = writeln!(
        out,
        "          standard deviation {x:.3}, {y:.3}, {z:.3} arcsec about x, y, z"
    );
    for model in std::iter::once(&report.model).chain(&report.others) {
        of_model(&mut out, model, report.draws);
    }
    let _ = writeln!(
        out,
        "\nError: measured over modelled density, dB, with its 1 sigma were the data a draw of the model."
    );
    let _ = writeln!(
        out,
        "Cost: [M23] Eq. 19 per degree of freedom; 1 for a draw of the model."
    );
    for note in &report.notes {
        let _ = writeln!(out, "Note      {note}");
    }
    out
}

fn of_model(out: &mut String, model: &ComparedModel, draws: u64) {
    let stars = match model.stars {
        StarSource::Telemetry => "the stars of the bundle",
        StarSource::Catalogue => "the brightest stars of the bundle's catalogue",
        StarSource::Generated => "made-up stars, since the bundle has none",
        StarSource::None => "no stars needed",
    };
    let _ = writeln!(out, "\nModel     {}: {draws} draws, {stars}", model.name);
    let axes = [&model.axes.x, &model.axes.y, &model.axes.z];
    let _ = writeln!(out, "{:<26}{:>24}{:>24}{:>24}", "", "X", "Y", "Z");
    let mut row = |name: &str, cell: &dyn Fn(&ComparedAxis) -> String| {
        let cells = axes.map(|axis| format!("{:>24}", cell(axis))).concat();
        let _ = writeln!(out, "{name:<26}{cells}");
    };
    for (k, band) in model.axes.x.bands.iter().enumerate() {
        row(&format!("error {}", ends(band)), &|axis| {
            axis.bands.get(k).map_or_else(String::new, error)
        });
    }
    row("cost", &|axis| number(axis.log_psd_cost));
    row("bins above 3 sigma", &|axis| {
        if axis.above_3_sigma.is_finite() {
            format!("{:.1} %", 100.0 * axis.above_3_sigma)
        } else {
            "-".to_owned()
        }
    });
    row("standard deviation, arcsec", &|axis| {
        format!("{:.3}", axis.model_std_arcsec)
    });
}

fn number(value: f64) -> String {
    match value {
        v if !v.is_finite() => "-".to_owned(),
        v if v >= 1e5 => format!("{v:.2e}"),
        v => format!("{v:.3}"),
    }
}

fn ends(band: &ComparedBand) -> String {
    match (band.from_hz > 0.0, band.to_hz) {
        (false, Some(to)) => format!("below {:.0} mHz, dB", 1e3 * to),
        (true, Some(to)) => format!("{:.0}-{:.0} mHz, dB", 1e3 * band.from_hz, 1e3 * to),
        (_, None) => format!("above {:.0} mHz, dB", 1e3 * band.from_hz),
    }
}

fn error(band: &ComparedBand) -> String {
    match (band.error_db, band.sigma_db) {
        (Some(error), Some(sigma)) => format!("{error:+.2} +- {sigma:.2}"),
        _ => "-".to_owned(),
    }
}
