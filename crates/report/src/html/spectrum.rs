//! Spectra of what is left, and of the models beside what was measured.
//!
//! ```text
//! attitude   the density of the residual about each axis
//! stars      of each star's residual; averaged over the stars with their degrees of freedom
//! ```
//!
//! Not physics: pictures of crate `comparison`'s estimates.

use std::collections::BTreeMap;

use comparison::{Compared, Spectrum};
use figures::{Colour, Figure, Mark, Panel};
use telemetry::StarResiduals;

use super::data::View;
use super::{Page, Run};
use crate::number::{change, hertz, short};

const UNIT: &str = "arcsec²/Hz";
/// Stars whose spectra are averaged.
const STARS: usize = 40;
/// Fewest rows of a star that has one.
const ROWS: usize = 32;

/// A density with its band of 95 %.
struct Density {
    f: Vec<f64>,
    psd: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
    fs_hz: f64,
}

impl Density {
    /// `None` where a bin has no degrees of freedom.
    fn of(plan: &Spectrum, values: &[f64]) -> Option<Self> {
        let psd = plan.of(values).ok()?;
        let band = psd.confidence(0.95).ok()?;
        Some(Self {
            f: psd.frequency_hz,
            psd: psd.psd,
            low: band.lower,
            high: band.upper,
            fs_hz: plan.fs_hz(),
        })
    }
}

/// Before and after, an axis each.
type Pairs = Vec<[Density; 2]>;

pub(super) fn residual(page: &mut Page, run: &Run<'_>) {
    page.section("spectrum", "Spectrum of the residual", |page| {
        let closed = run.closed;
        let (view, pairs, how) = if let Some(rows) = &closed.attitude {
            let view = View::of_attitude(rows);
            let pairs = attitude(&view);
            (view, pairs, String::new())
        } else if let Some(rows) = &closed.stars {
            let view = View::of_stars(rows);
            let (pairs, stars) = pooled(rows);
            let how = format!(" The mean of the densities of {stars} stars, taken as independent.");
            (view, pairs, how)
        } else {
            return;
        };
        let Some(pairs) = pairs else {
            page.paragraph("None: the series is too short, or its frames are unrelated.");
            return;
        };
        draw(page, run, &view, &pairs, &how);
    });
}

fn draw(page: &mut Page, run: &Run<'_>, view: &View<'_>, pairs: &Pairs, how: &str) {
    let added = !run.closed.report.effects.is_empty();
    let declared = match view.kind {
        "star" => declared_white(run),
        _ => None,
    };
    let mut panels = vec![];
    for ([before, after], name) in pairs.iter().zip(view.axes) {
        let mut panel = Panel::psd(name, UNIT);
        let shown: &[(&Density, Colour, &str)] = if added {
            &[
                (before, Colour::BEFORE, "before"),
                (after, Colour::AFTER, "after"),
            ]
        } else {
            &[(before, Colour::MEASURED, "measured")]
        };
        for (d, colour, _) in shown {
            panel = panel.with(Mark::band(&d.f, &d.low, &d.high, *colour));
        }
        for (d, colour, label) in shown {
            panel = panel.with(
                Mark::line(&d.f, &d.psd, *colour)
                    .wide(1.8)
                    .named(&format!("{label}, with its 95 % band")),
            );
        }
        if let Some(variance) = declared {
            let level = 2.0 * variance / before.fs_hz;
            let ends = [before.f[0], before.f[before.f.len() - 1]];
            panel = panel.with(
                Mark::line(&ends, &[level; 2], Colour::MODEL)
                    .dashed()
                    .named("white noise that the model declares"),
            );
        }
        panels.push(panel);
    }
    let title = if added {
        changes(pairs, view)
    } else {
        let said: Vec<String> = pairs
            .iter()
            .zip(view.axes)
            .map(|([before, _], name)| format!("{} dB {name}", short(tilt(before))))
            .collect();
        format!(
            "The {} residual: its lowest decade lies above its highest by {}",
            view.kind,
            said.join(", ")
        )
    };
    let columns = panels.len();
    let figure = Figure::new(&title, panels).sized([1080.0 / columns as f64, 360.0]);
    page.figure(
        &figure,
        &format!(
            "One-sided density, averaged over tenths of a decade; gaps are left out, short holes bridged, irregular series analysed at their own times. Areas: where the true density lies with 95 %.{how}"
        ),
    );
}

/// How the density changes in each third of the frequencies, dB an axis.
fn changes(pairs: &Pairs, view: &View<'_>) -> String {
    let f = &pairs[0][0].f;
    let (low, high) = (f[0], f[f.len() - 1]);
    let third = (high / low).powf(1.0 / 3.0);
    let cuts = [low * third, high / third];
    let of = |from: f64, to: f64| -> String {
        let said: Vec<String> = pairs
            .iter()
            .map(|[before, after]| {
                // equal steps of ln f: a sum of f psd is the power
                let power = |d: &Density| -> f64 {
                    let bins = d.f.iter().zip(&d.psd);
                    bins.filter(|(f, _)| (from..to).contains(*f))
                        .map(|(f, p)| f * p)
                        .sum()
                };
                change(10.0 * (power(after) / power(before)).log10())
            })
            .collect();
        said.join(", ")
    };
    format!(
        "Power of the {} residual {}, after over before: {} dB below {}; {} dB up to {}; {} dB above",
        view.kind,
        view.axes.join(", "),
        of(0.0, cuts[0]),
        hertz(cuts[0]),
        of(cuts[0], cuts[1]),
        hertz(cuts[1]),
        of(cuts[1], f64::INFINITY),
    )
}

/// Mean density of the lowest tenth of the frequencies over that of the highest, dB.
fn tilt(d: &Density) -> f64 {
    let decade = |from: f64, to: f64| {
        let inside: Vec<f64> =
            d.f.iter()
                .zip(&d.psd)
                .filter(|(f, _)| (from..=to).contains(*f))
                .map(|(_, p)| p.log10())
                .collect();
        inside.iter().sum::<f64>() / inside.len().max(1) as f64
    };
    let (low, high) = (d.f[0], d.f[d.f.len() - 1]);
    10.0 * (decade(low, 10.0 * low) - decade(0.1 * high, high))
}

fn attitude(view: &View<'_>) -> Option<Pairs> {
    (0..3)
        .map(|axis| {
            let before = view.kept(0, axis);
            let plan = Spectrum::new(view.t_s, &before).ok()?;
            Some([
                Density::of(&plan, &before)?,
                Density::of(&plan, &view.kept(1, axis))?,
            ])
        })
        .collect()
}

/// Variance an axis that the declared noise leaves in a star's residual, arcsec^2: what the report's
/// chi-squared was divided by.
fn declared_white(run: &Run<'_>) -> Option<f64> {
    let before = &run.closed.report.before;
    let [x, y] = before.star_rms_arcsec?;
    let chi2 = before.chi2_per_dof?;
    (chi2 > 0.0).then(|| 0.5 * (x * x + y * y) / chi2)
}

/// Sums over one group of frequencies: of dof f, dof density, dof.
type Sums = BTreeMap<i64, [[f64; 3]; 4]>;

/// The mean over stars, and over how many.
fn pooled(rows: &StarResiduals) -> (Option<Pairs>, usize) {
    let view = View::of_stars(rows);
    let kept: Vec<[Vec<f64>; 2]> = (0..2)
        .map(|axis| [0, 1].map(|when| view.kept(when, axis)))
        .collect();
    let mut tracks: BTreeMap<(i64, i32), Vec<usize>> = BTreeMap::new();
    for row in 0..rows.t_s.len() {
        tracks
            .entry((rows.star_id[row], rows.slot[row]))
            .or_default()
            .push(row);
    }
    let mut tracks: Vec<Vec<usize>> = tracks.into_values().filter(|t| t.len() >= ROWS).collect();
    tracks.sort_by_key(|track| std::cmp::Reverse(track.len()));
    tracks.truncate(STARS);
    let mut sums = Sums::new();
    let (mut rates, mut last) = (vec![], None);
    for track in &tracks {
        let t: Vec<f64> = track.iter().map(|&r| rows.t_s[r]).collect();
        let of = |axis: usize, when: usize| -> Vec<f64> {
            track.iter().map(|&r| kept[axis][when][r]).collect()
        };
        let Ok(plan) = Spectrum::new(&t, &of(0, 0)) else {
            continue;
        };
        let Ok(psds) = [(0, 0), (0, 1), (1, 0), (1, 1)]
            .iter()
            .map(|&(axis, when)| plan.of(&of(axis, when)))
            .collect::<Result<Vec<_>, _>>()
        else {
            continue;
        };
        rates.push(plan.fs_hz());
        for (k, psd) in psds.iter().enumerate() {
            for i in 0..psd.psd.len() {
                #[expect(clippy::cast_possible_truncation, reason = "tenths of a decade")]
                let group = (10.0 * psd.frequency_hz[i].log10()).floor() as i64;
                let sum = &mut sums.entry(group).or_default()[k];
                sum[0] += psd.dof[i] * psd.frequency_hz[i];
                sum[1] += psd.dof[i] * psd.psd[i];
                sum[2] += psd.dof[i];
            }
        }
        last = psds.into_iter().next();
    }
    let stars = rates.len();
    let Some(mut psd) = last else {
        return (None, 0);
    };
    let fs_hz = rates.iter().sum::<f64>() / stars as f64;
    let mut density = |k: usize| {
        let column = |of: &dyn Fn(&[f64; 3]) -> f64| sums.values().map(|s| of(&s[k])).collect();
        psd.frequency_hz = column(&|s| s[0] / s[2]);
        psd.psd = column(&|s| s[1] / s[2]);
        psd.dof = column(&|s| s[2]);
        let band = psd.confidence(0.95).ok()?;
        Some(Density {
            f: psd.frequency_hz.clone(),
            psd: psd.psd.clone(),
            low: band.lower,
            high: band.upper,
            fs_hz,
        })
    };
    let mut pair = |axis: usize| Some([density(2 * axis)?, density(2 * axis + 1)?]);
    let pairs = match (pair(0), pair(1)) {
        (Some(x), Some(y)) => Some(vec![x, y]),
        _ => None,
    };
    (pairs, stars)
}

/// Ensembles of both models beside the measured attitude error.
pub(super) fn models(page: &mut Page, run: &Run<'_>) {
    page.section(
        "models",
        "Models flown along the same motion",
        |page| match run.compared {
            Ok(compared) => page.figure(&flown(compared), &caption(compared)),
            Err(why) => page.paragraph(&format!("Not drawn: {why}.")),
        },
    );
}

fn flown(compared: &Compared) -> Figure {
    let panels = [0, 1, 2]
        .map(|axis| {
            let measured = &compared.measured[axis];
            let mut panel = Panel::psd(View::ATTITUDE[axis], UNIT);
            if let Ok(band) = measured.confidence(0.95) {
                let f = &measured.frequency_hz;
                panel = panel.with(Mark::band(f, &band.lower, &band.upper, Colour::MEASURED));
            }
            panel = panel.with(
                Mark::line(&measured.frequency_hz, &measured.psd, Colour::MEASURED)
                    .wide(1.8)
                    .named("measured, with its 95 % band"),
            );
            let looks = [
                (Colour::MODEL, "declared model"),
                (Colour::AFTER, "with what was added"),
            ];
            for (model, (colour, name)) in compared.models.iter().zip(looks) {
                let ensemble = &model.axes[axis];
                let f = &ensemble.frequency_hz;
                panel = panel
                    .with(
                        Mark::line(f, &ensemble.mean(), colour)
                            .wide(1.8)
                            .named(&format!("{name}, mean")),
                    )
                    .with(
                        Mark::line(f, &ensemble.upper(), colour)
                            .wide(1.0)
                            .dashed()
                            .named(&format!("{name}, mean + 3σ")),
                    );
            }
            panel
        })
        .into();
    let costs = |k: usize| -> Option<[f64; 3]> {
        let axes = match k {
            0 => &compared.report.model.axes,
            k => &compared.report.others.get(k - 1)?.axes,
        };
        Some([&axes.x, &axes.y, &axes.z].map(|axis| axis.log_psd_cost))
    };
    let said = |c: [f64; 3]| c.map(short).join(", ");
    let first = costs(0).map_or_else(String::new, said);
    let title = match costs(1) {
        Some(after) => format!(
            "Log-PSD cost about X, Y, Z: {first} for the declared model, {} with what was added",
            said(after)
        ),
        None => format!("Log-PSD cost about X, Y, Z: {first} for the declared model"),
    };
    Figure::new(&title, panels).sized([360.0, 360.0])
}

fn caption(compared: &Compared) -> String {
    let mut out = format!(
        "The attitude error as measured, nothing taken off, and {} draws of each model along the same motion with the same stars: what each model predicts for a flight. A draw of the model has a cost of 1 per degree of freedom.",
        compared.report.draws
    );
    for note in &compared.report.notes {
        out.push(' ');
        out.push_str(note);
        out.push('.');
    }
    out
}
