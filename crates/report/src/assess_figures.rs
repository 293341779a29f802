//! Pictures of an assessment: residuals, and the noise against the span with its plateau.

use assess::Assessment;
use figures::{Axis, Colour, Envelope, Figure, Mark, Panel};

const AXES: [&str; 3] = ["X", "Y", "Z"];

/// Names of files and their SVG: `noise.svg` (\[A01\] Fig. 2 for all axes) and `residual.svg` (Figs. 1 and 3).
#[must_use]
pub fn assess_figures(found: &Assessment) -> Vec<(String, String)> {
    let noise = (0..3).map(|axis| noise(found, axis)).collect();
    let residual = (0..3).map(|axis| residual(found, axis)).collect();
    vec![
        (
            "noise.svg".to_owned(),
            Figure::new(
                "Noise against the span of the parabola that is taken off",
                noise,
            )
            .svg(),
        ),
        (
            "residual.svg".to_owned(),
            Figure::new("Residual about the tracker's axes", residual).svg(),
        ),
    ]
}

fn noise(found: &Assessment, axis: usize) -> Panel {
    let noise = &found.axes[axis];
    let span: Vec<f64> = noise.spans.iter().map(|s| s.span_s).collect();
    let sigma: Vec<f64> = noise.spans.iter().map(|s| s.sigma).collect();
    let error: Vec<f64> = noise
        .spans
        .iter()
        .map(|s| s.sigma * (0.5 / s.dof).sqrt())
        .collect();
    let mut panel = Panel::new(
        &format!("about {}", AXES[axis]),
        Axis::log("span, s"),
        Axis::log("noise, arcsec"),
    )
    .with(Mark::line(&span, &sigma, Colour::MEASURED))
    .with(Mark::with_errors(&span, &sigma, &error, Colour::MEASURED).named("parabolas removed"));
    if let Some(plateau) = noise.plateau {
        let level = [plateau.sigma; 2];
        panel = panel.with(
            Mark::line(&plateau.span_s, &level, Colour::MODEL)
                .wide(3.0)
                .named("plateau"),
        );
    }
    if let Some(allan) = noise.allan {
        panel = panel.with(
            Mark::horizontal(allan.sigma, Colour::DRAWS)
                .dashed()
                .named("Allan deviation"),
        );
    }
    panel
}

fn residual(found: &Assessment, axis: usize) -> Panel {
    let mut panel = Panel::time(&format!("about {}", AXES[axis]), "arcsec");
    let x = &found.residual_arcsec[axis];
    if x.len() > 2000 {
        let envelope = Envelope::new(&found.t_s, x, 600);
        panel = panel.with(Mark::band(
            &envelope.x,
            &envelope.low,
            &envelope.high,
            Colour::MEASURED,
        ));
    } else {
        panel = panel.with(Mark::line(&found.t_s, x, Colour::MEASURED));
    }
    panel
}
