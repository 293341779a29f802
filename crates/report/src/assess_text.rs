//! An assessment in words and numbers.

use std::fmt::Write as _;

use assess::{Assessment, AxisNoise, Ecss, GyroSolution, RotatorFindings};
use telemetry::report::AssessMethod;

/// Writing to a string cannot fail.
macro_rules! line {
    ($out:expr) => { $out.push('\n') };
    ($out:expr, $($arg:tt)*) => {{ let _ = writeln!($out, $($arg)*); }};
}

/// What a flight analyst wants to know first: total and inherent noise, and what is in between.
#[must_use]
pub fn assess_summary(found: &Assessment) -> String {
    let mut out = String::new();
    let method = match found.report.method {
        AssessMethod::RigidRotator => "a rigid body stands in for the truth",
        AssessMethod::Gyro => "the gyro stands in for the truth",
        AssessMethod::Reference => "the reference stands in for the truth",
    };
    let counts = &found.counts;
    line!(out, "Method    {method}");
    line!(
        out,
        "Frames    {} of {} used, {} outliers, {} outside, {} sign flips, {} gaps (longest {:.1} s)",
        counts.used,
        counts.frames,
        counts.outliers,
        counts.outside,
        counts.sign_flips,
        counts.gaps,
        counts.longest_gap_s
    );
    line!(out);
    noise(&mut out, found);
    line!(out);
    pointing(&mut out, &found.ecss);
    if let Some(check) = &found.requirement {
        let met = |met| if met { "met" } else { "not met" };
        line!(out);
        line!(
            out,
            "Required  {} arcsec: {} at 1 sigma, {} at 3 sigma",
            check.required_arcsec,
            met(check.met_at_one_sigma),
            met(check.met_at_three_sigma)
        );
    }
    if let Some(rotator) = &found.rotator {
        line!(out);
        rigid_body(&mut out, rotator);
    }
    if let Some(gyro) = &found.gyro {
        line!(out);
        biases(&mut out, gyro);
    }
    for note in &found.notes {
        line!(out, "Note      {note}");
    }
    out
}

/// Total and inherent noise, axis by axis.
fn noise(out: &mut String, found: &Assessment) {
    line!(
        out,
        "{:<34}{:>10}{:>10}{:>10}",
        "1 sigma, arcsec, tracker axes",
        "X",
        "Y",
        "Z"
    );
    let total = found.report.total_arcsec.map(|x| x.map(Some));
    row(out, "total", total.unwrap_or([None; 3]));
    let of = |f: &dyn Fn(&AxisNoise) -> Option<f64>| found.axes.each_ref().map(f);
    row(
        out,
        "inherent, plateau",
        of(&|a| a.plateau.map(|p| p.sigma)),
    );
    row(
        out,
        "  its uncertainty",
        of(&|a| a.plateau.map(|p| p.error)),
    );
    row(
        out,
        "Allan deviation at one frame",
        of(&|a| a.allan.map(|r| r.sigma)),
    );
    row(
        out,
        "floor of the spectrum",
        of(&|a| a.floor.map(|r| r.sigma)),
    );
    row(out, "flat intervals, pooled", of(&|a| a.flat_sigma));
    row(
        out,
        "plateau from, s",
        of(&|a| a.plateau.map(|p| p.span_s[0])),
    );
    row(
        out,
        "plateau to, s",
        of(&|a| a.plateau.map(|p| p.span_s[1])),
    );
}

/// Errors by the definitions of ECSS.
fn pointing(out: &mut String, ecss: &Ecss) {
    line!(
        out,
        "ECSS, {}, windows of {:.0} s, 99.73 % of the time",
        ecss.interpretation,
        ecss.window_s
    );
    row(out, "AKE (and APE)", ecss.ake_arcsec[1].map(Some));
    row(out, "MPE", ecss.mpe_arcsec[1].map(Some));
    row(out, "RPE", ecss.rpe_arcsec[1].map(Some));
    let pde = ecss.pde_arcsec.map(|x| x[1].map(Some));
    row(out, "PDE", pde.unwrap_or([None; 3]));
}

/// What the gyro errs by.
fn biases(out: &mut String, gyro: &GyroSolution) {
    for axis in 0..3 {
        line!(
            out,
            "Gyro bias {} {:>10.5} +- {:.5} arcsec/s",
            ["X", "Y", "Z"][axis],
            gyro.bias_arcsec_s[axis],
            gyro.bias_sigma_arcsec_s[axis]
        );
    }
    line!(
        out,
        "Walk      {:.4} arcsec/sqrt(s), of the gyro or of the tracker",
        gyro.walk_arcsec_rt_s
    );
}

fn row(out: &mut String, name: &str, values: [Option<f64>; 3]) {
    let _ = write!(out, "{name:<34}");
    for value in values {
        let _ = match value.filter(|x| x.is_finite()) {
            None => write!(out, "{:>10}", "-"),
            Some(x) if x.abs() < 10.0 => write!(out, "{x:>10.3}"),
            Some(x) => write!(out, "{x:>10.1}"),
        };
    }
    line!(out);
}

fn rigid_body(out: &mut String, found: &RotatorFindings) {
    let closing = &found.closing;
    let axis = &found.spin_axis;
    line!(
        out,
        "Spin      {:.4} rpm about ({:.5}, {:.5}, {:.5}) of the tracker, nutation {:.3} deg, I3/IT {:.4}",
        found.spin_rpm,
        axis.x,
        axis.y,
        axis.z,
        closing.last.model.body.nutation_rad().to_degrees(),
        closing.last.model.body.inertia.axial_ratio
    );
    let [x, y, z] = found.mean_before_deg;
    line!(
        out,
        "Before    mean residual ({x:.4}, {y:.4}, {z:.4}) deg about body axes with the nominal alignment"
    );
    let [x, y, z] = found.body_arcsec;
    line!(
        out,
        "Aligned   the axisymmetric body leaves ({x:.1}, {y:.1}, {z:.1}) arcsec about body axes"
    );
    line!(out);
    line!(out, "Loop, rms out of fold, arcsec, tracker axes");
    for added in &closing.added {
        let [b, a] = [added.before_arcsec, added.after_arcsec];
        line!(
            out,
            "  {:<18}({:.2}, {:.2}, {:.2}) -> ({:.2}, {:.2}, {:.2})",
            added.term.id(),
            b[0],
            b[1],
            b[2],
            a[0],
            a[1],
            a[2]
        );
        for p in found.parameters_of(added.term, added.index) {
            let sigma = p.estimate.sigma.unwrap_or(f64::NAN);
            line!(
                out,
                "    {:<22}{:>14.7} +- {:.1e} {}",
                p.name,
                p.estimate.value,
                sigma,
                p.estimate.unit
            );
        }
    }
    for looked in &closing.considered {
        let said = match looked.p_value {
            None => "this motion cannot show it".to_owned(),
            Some(p) => format!("not significant (p {p:.2})"),
        };
        line!(out, "  {:<18}{said}", looked.term.id());
    }
    let lines = &closing.last.model.oscillations;
    if !lines.is_empty() {
        let said: Vec<String> = lines
            .iter()
            .map(|l| format!("{:.5} Hz ({:.0} s)", l.frequency_hz, 1.0 / l.frequency_hz))
            .collect();
        line!(
            out,
            "  The axisymmetric model is not sufficient: it leaves oscillations of {}",
            said.join(", ")
        );
    }
}
