//! The figures of the paper for any model and bundle.

use comparison::{AXES, BANDS_HZ, Compared, Ensemble};
use figures::{Axis, Colour, Envelope, Figure, Mark, Panel};
use telemetry::report::ComparedAxis;

const UNIT: &str = "arcsec²/Hz";

/// Names of files and their SVG: `psd.svg`, `psd_x.svg` and so on, `error.svg`, `residual.svg`, and
/// `distortion.svg` of a hybrid model with one.
#[must_use]
pub fn compare_figures(compared: &Compared) -> Vec<(String, String)> {
    let mut out = vec![(
        "psd.svg".to_owned(),
        Figure::new(&title(compared), [0, 1, 2].map(|i| psd(compared, i)).into())
            .noted(&note(compared))
            .svg(),
    )];
    for (i, name) in AXES.iter().enumerate() {
        let figure = Figure::new(&title(compared), vec![psd(compared, i)])
            .sized([820.0, 500.0])
            .noted(&note(compared));
        out.push((format!("psd_{name}.svg"), figure.svg()));
    }
    out.push(("error.svg".to_owned(), errors(compared).svg()));
    out.push(("residual.svg".to_owned(), residuals(compared).svg()));
    if let Some(figure) = distortion(compared) {
        out.push(("distortion.svg".to_owned(), figure.svg()));
    }
    out
}

fn title(compared: &Compared) -> String {
    format!(
        "{}: {} draws against the measured residual",
        compared.models[0].name, compared.report.draws
    )
}

fn note(compared: &Compared) -> String {
    let axes = &compared.report.model.axes;
    let said = |axis: &ComparedAxis| {
        format!(
            "{:.2} ({:.0} % of bins above 3σ)",
            axis.log_psd_cost,
            100.0 * axis.above_3_sigma
        )
    };
    format!(
        "Log-PSD cost per degree of freedom, 1 for a draw of the model: x {}, y {}, z {}. Dotted: the ends of the bands of the report.",
        said(&axes.x),
        said(&axes.y),
        said(&axes.z)
    )
}

fn panel_of(axis: usize) -> Panel {
    let mut panel = Panel::psd(&format!("about {}", AXES[axis]), UNIT);
    for f in BANDS_HZ {
        panel = panel.with(Mark::vertical(f, Colour::DRAWS).beyond_the_frame());
    }
    panel
}

/// \[M23\] Figs. 8, 11, 12, 16, 17.
fn psd(compared: &Compared, axis: usize) -> Panel {
    let model = &compared.models[0].axes[axis];
    let f = &model.frequency_hz;
    let mut panel = panel_of(axis)
        .with(
            Mark::draws(f, &model.draws, Colour::DRAWS)
                .beyond_the_frame()
                .named("draws of the model"),
        )
        .with(
            Mark::line(f, &model.upper(), Colour::BOUND)
                .dashed()
                .named("mean + 3σ"),
        )
        .with(Mark::line(f, &model.mean(), Colour::MODEL).named("mean"));
    for (k, other) in compared.models[1..].iter().enumerate() {
        let mean = other.axes[axis].mean();
        let line = Mark::line(f, &mean, Colour::of_other(k)).wide(2.0);
        panel = panel.with(line.named(&format!("{}, mean", other.name)));
    }
    let measured = &compared.measured[axis];
    panel.with(
        Mark::line(&measured.frequency_hz, &measured.psd, Colour::MEASURED)
            .wide(2.0)
            .named("measured"),
    )
}

/// Measured over modelled, with the spread of the draws.
fn errors(compared: &Compared) -> Figure {
    let panels = [0, 1, 2].map(|i| {
        let model = &compared.models[0].axes[i];
        let f = &model.frequency_hz;
        let (mean, sd) = model.decibels();
        let side = |sign: f64| -> Vec<f64> { sd.iter().map(|s| 3.0 * sign * s).collect() };
        let y = Axis::linear("measured over modelled PSD, dB");
        let mut panel = Panel::new(&format!("about {}", AXES[i]), Axis::log("frequency, Hz"), y)
            .with(
                Mark::band(f, &side(-1.0), &side(1.0), Colour::DRAWS)
                    .at_opacity(0.5)
                    .named("3σ of the draws"),
            )
            .with(Mark::horizontal(0.0, Colour::INK));
        for f in BANDS_HZ {
            panel = panel.with(Mark::vertical(f, Colour::DRAWS).beyond_the_frame());
        }
        let of = |mean: &[f64]| -> Vec<f64> {
            let pairs = compared.measured[i].psd.iter().zip(mean);
            pairs.map(|(p, m)| 10.0 * p.log10() - m).collect()
        };
        for (k, other) in compared.models[1..].iter().enumerate() {
            let error = of(&other.axes[i].decibels().0);
            let line = Mark::line(f, &error, Colour::of_other(k));
            panel = panel.with(line.named(&format!("against {}", other.name)));
        }
        panel.with(
            Mark::line(f, &of(&mean), Colour::MODEL)
                .wide(2.0)
                .named("against the model"),
        )
    });
    Figure::new("Log-PSD error: measured over modelled", panels.into())
        .noted("0 dB: the model is right. A draw of the model stays inside the grey area.")
}

fn residuals(compared: &Compared) -> Figure {
    let residual = &compared.residual;
    let panels = [0, 1, 2].map(|i| {
        let kept = residual.kept(i);
        let mean = |values: &[f64]| {
            let finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
            finite.iter().sum::<f64>() / finite.len().max(1) as f64
        };
        let about = |values: &[f64]| -> Vec<f64> {
            let mean = mean(values);
            values.iter().map(|v| v - mean).collect()
        };
        let panel = Panel::time(&format!("about {}", AXES[i]), "residual, arcsec");
        [
            (about(&kept), Colour::MEASURED, "measured"),
            (
                about(&compared.models[0].first[i]),
                Colour::MODEL,
                "first draw of the model",
            ),
        ]
        .iter()
        .fold(panel, |panel, (y, colour, name)| {
            series(panel, &residual.t_s, y, *colour, name)
        })
    });
    Figure::new("Residual of the attitude, its mean removed", panels.into())
        .in_columns(1)
        .sized([1000.0, 250.0])
        .noted("Outliers are left out. Of a long series: its median and the middle 90 % over some pixels of time.")
}

/// Points; of a long series what they would cover.
fn series(panel: Panel, t_s: &[f64], y: &[f64], colour: Colour, name: &str) -> Panel {
    if t_s.len() <= 3000 {
        return panel.with(
            Mark::points(t_s, y, 1.0, colour)
                .at_opacity(0.7)
                .named(name),
        );
    }
    let e = Envelope::new(t_s, y, 300);
    panel
        .with(Mark::band(&e.x, &e.low, &e.high, colour).named(name))
        .with(Mark::line(&e.x, &e.median, colour).wide(1.0))
}

/// \[M23\] Fig. 13.
fn distortion(compared: &Compared) -> Option<Figure> {
    let model = &compared.models[0];
    let plain: &[Ensemble; 3] = model.without_distortion.as_ref()?;
    let panels = [0, 1, 2].map(|i| {
        let f = &plain[i].frequency_hz;
        let measured = &compared.measured[i];
        panel_of(i)
            .with(
                Mark::line(f, &plain[i].upper(), Colour::OTHER)
                    .named("mean + 3σ without distortion"),
            )
            .with(
                Mark::line(f, &model.axes[i].upper(), Colour::BOUND)
                    .dashed()
                    .named("mean + 3σ with distortion"),
            )
            .with(
                Mark::line(&measured.frequency_hz, &measured.psd, Colour::MEASURED)
                    .named("measured"),
            )
    });
    Some(
        Figure::new("Hybrid model with and without distortion", panels.into())
            .noted("What distortion adds to the Gauss-Markov process and the white noise."),
    )
}
