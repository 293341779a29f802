//! The numbers behind the figures of a comparison, as CSV.

use std::fmt::Write as _;

use comparison::{AXES, Compared};

/// Names of files and their content.
///
/// `psd.csv` has a row for each axis and frequency: `axis, frequency_hz, dof, measured, mean,
/// upper_3sigma`, then for a hybrid model with distortion `upper_3sigma_without_distortion`, then
/// `mean_<k>, upper_3sigma_<k>` of each model beside the first. `draws.csv` has `axis, frequency_hz, d0,
/// d1, ...` of the first model. Densities are one-sided, arcsec^2/Hz.
#[must_use]
pub fn compare_tables(compared: &Compared) -> Vec<(String, String)> {
    vec![
        ("psd.csv".to_owned(), psd(compared)),
        ("draws.csv".to_owned(), draws(compared)),
    ]
}

fn psd(compared: &Compared) -> String {
    let model = &compared.models[0];
    let mut out = "axis,frequency_hz,dof,measured,mean,upper_3sigma".to_owned();
    if model.without_distortion.is_some() {
        out.push_str(",upper_3sigma_without_distortion");
    }
    for k in 1..compared.models.len() {
        // writing to a string cannot fail
        let _ = write!(out, ",mean_{k},upper_3sigma_{k}");
    }
    out.push('\n');
    for (i, name) in AXES.iter().enumerate() {
        let measured = &compared.measured[i];
        let mut columns = vec![
            measured.frequency_hz.clone(),
            measured.dof.clone(),
            measured.psd.clone(),
            model.axes[i].mean(),
            model.axes[i].upper(),
        ];
        columns.extend(
            model
                .without_distortion
                .as_ref()
                .map(|plain| plain[i].upper()),
        );
        for other in &compared.models[1..] {
            columns.push(other.axes[i].mean());
            columns.push(other.axes[i].upper());
        }
        rows(&mut out, name, &columns);
    }
    out
}

fn draws(compared: &Compared) -> String {
    let model = &compared.models[0];
    let mut out = "axis,frequency_hz".to_owned();
    for k in 0..model.axes[0].draws.len() {
        let _ = write!(out, ",d{k}");
    }
    out.push('\n');
    for (i, name) in AXES.iter().enumerate() {
        let mut columns = vec![model.axes[i].frequency_hz.clone()];
        columns.extend(model.axes[i].draws.iter().cloned());
        rows(&mut out, name, &columns);
    }
    out
}

fn rows(out: &mut String, axis: &str, columns: &[Vec<f64>]) {
    for k in 0..columns[0].len() {
        out.push_str(axis);
        for column in columns {
            let _ = write!(out, ",{:e}", column[k]);
        }
        out.push('\n');
    }
}
