//! The figures of a run: [M23] Figs. 2, 3, 6, 7, 9, 10 and 15.

use comparison::{AXES, Scene};
use figures::{Axis, Colour, Figure, Mark, Panel};

const COLOURS: [Colour; 3] = [Colour::MEASURED, Colour::MODEL, Colour::AFTER];

/// Names of files and their SVG; what the run does not have has no figure.
#[must_use]
pub fn scene_figures(scene: &Scene, title: &str) -> Vec<(String, String)> {
    let mut out = vec![];
    let mut add = |name: &str, figure: Option<Figure>| {
        out.extend(figure.map(|figure| (name.to_owned(), figure.svg())));
    };
    add("distortion.svg", distortion(scene, title));
    add("centroid.svg", centroid(scene, title));
    add("reference.svg", motion(scene, title));
    add("tracks.svg", tracks(scene, title));
    add("rates.svg", rates(scene, title));
    add("star.svg", star(scene, title));
    out
}

fn distortion(scene: &Scene, title: &str) -> Option<Figure> {
    let [x, y, dx, dy] = scene.distortion.as_ref()?;
    let rms = |d: &[f64]| (d.iter().map(|d| d * d).sum::<f64>() / d.len() as f64).sqrt();
    let panel = Panel::focal_plane("displacement of a star's image", scene.half_size_px).with(
        Mark::arrows([x, y], [dx, dy], "arcsec", Colour::MEASURED).named("distortion residual"),
    );
    Some(
        Figure::new(
            &format!("{title}: distortion residual of this draw"),
            vec![panel],
        )
        .sized([560.0, 580.0])
        .noted(&format!(
            "Root mean square over the arrows: {:.2} arcsec along x, {:.2} along y.",
            rms(dx),
            rms(dy)
        )),
    )
}

fn centroid(scene: &Scene, title: &str) -> Option<Figure> {
    let [at, x, y] = scene.centroid.as_ref()?;
    let panel = Panel::new(
        "against the position of the spot",
        Axis::linear("position, px (centred)"),
        Axis::linear("centroid error, arcsec"),
    )
    .with(Mark::line(at, x, COLOURS[0]).named("along x"))
    .with(Mark::line(at, y, COLOURS[1]).dashed().named("along y"));
    let figure = Figure::new(&format!("{title}: centroid error"), vec![panel]);
    Some(figure.sized([620.0, 340.0]))
}

fn motion(scene: &Scene, title: &str) -> Option<Figure> {
    let spectra = scene.motion.as_ref()?;
    let mut panel = Panel::psd("attitude, its straight line removed", "arcsec²/Hz");
    for (axis, psd) in spectra.iter().enumerate() {
        let line = Mark::line(&psd.frequency_hz, &psd.psd, COLOURS[axis]);
        panel = panel.with(line.named(&format!("about {}", AXES[axis])));
    }
    let figure = Figure::new(&format!("{title}: motion"), vec![panel]);
    Some(figure.sized([700.0, 420.0]))
}

fn tracks(scene: &Scene, title: &str) -> Option<Figure> {
    if scene.tracks.is_empty() {
        return None;
    }
    let mut panel = Panel::focal_plane("measured positions", scene.half_size_px);
    let lines = scene.tracks.iter();
    let lines = lines.map(|track| broken(&track.t_s, &track.x_px, &track.y_px));
    panel = panel.with(Mark::lines(lines.collect(), 1.2, Colour::MEASURED).named("tracks"));
    let first = |of: fn(&comparison::Track) -> &Vec<f64>| -> Vec<f64> {
        scene.tracks.iter().map(|track| of(track)[0]).collect()
    };
    let (x, y) = (first(|t| &t.x_px), first(|t| &t.y_px));
    panel = panel.with(Mark::points(&x, &y, 2.5, Colour::MODEL).named("first seen"));
    Some(
        Figure::new(&format!("{title}: star tracks"), vec![panel])
            .sized([560.0, 580.0])
            .noted(&format!("{} stars.", scene.tracks.len())),
    )
}

/// A line that breaks where a star was away: at steps of more than ten usual ones.
fn broken(t_s: &[f64], x: &[f64], y: &[f64]) -> [Vec<f64>; 2] {
    let shortest = t_s
        .windows(2)
        .map(|w| w[1] - w[0])
        .fold(f64::INFINITY, f64::min);
    let mut out = [vec![], vec![]];
    for k in 0..t_s.len() {
        if k > 0 && t_s[k] - t_s[k - 1] > 10.0 * shortest {
            out.iter_mut().for_each(|column| column.push(f64::NAN));
        }
        out[0].push(x[k]);
        out[1].push(y[k]);
    }
    out
}

fn rates(scene: &Scene, title: &str) -> Option<Figure> {
    if scene.t_s.is_empty() {
        return None;
    }
    let mut panel = Panel::time("rate of the tracker", "rate, deg/s");
    for axis in 0..3 {
        let line = Mark::line(&scene.t_s, &scene.rate_deg_s[axis], COLOURS[axis]);
        panel = panel.with(line.wide(1.2).named(&format!("about {}", AXES[axis])));
    }
    let figure = Figure::new(&format!("{title}: profile of the motion"), vec![panel]);
    Some(figure.sized([900.0, 320.0]))
}

fn star(scene: &Scene, title: &str) -> Option<Figure> {
    let track = scene.tracks.first()?;
    let panel = |name: &str, values: &[f64]| {
        let line = broken(&track.t_s, &track.t_s, values);
        Panel::time(
            &format!("star {} along {name}", track.star_id),
            &format!("{name}, px"),
        )
        .with(Mark::lines(vec![line], 1.2, Colour::MEASURED).named("measured"))
    };
    let panels = vec![panel("x", &track.x_px), panel("y", &track.y_px)];
    Some(
        Figure::new(&format!("{title}: the star seen longest"), panels)
            .in_columns(1)
            .sized([900.0, 260.0]),
    )
}
