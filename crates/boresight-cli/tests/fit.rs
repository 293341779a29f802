//! `boresight fit` on bundles that this test writes by itself, as another program would: its own random
//! numbers, its own quaternions, its own names of columns.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;

type Done = Result<(), Box<dyn std::error::Error>>;

/// `sigma_HSF` (arcsec), `tau` (s), `sigma_TN` (arcsec) about x, y, z.
const TRUTH: [[f64; 3]; 3] = [[3.0, 25.0, 4.0], [2.0, 60.0, 2.5], [20.0, 12.0, 40.0]];

fn boresight() -> Command {
    Command::new(env!("CARGO_BIN_EXE_boresight"))
}

/// A linear congruential generator (Knuth's constants), normals by Box and Muller.
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (-2.0 * self.uniform().ln()).sqrt() * (TAU * self.uniform()).cos()
    }
}

/// Hamilton's product, scalar first.
fn times(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn turn(theta: [f64; 3]) -> [f64; 4] {
    let angle = theta.iter().map(|c| c * c).sum::<f64>().sqrt();
    let s = if angle > 0.0 {
        (0.5 * angle).sin() / angle
    } else {
        0.5
    };
    [
        (0.5 * angle).cos(),
        s * theta[0],
        s * theta[1],
        s * theta[2],
    ]
}

/// What the frames of a test look like.
#[derive(Clone, Copy)]
struct Frames {
    count: u32,
    /// Times jitter by this part of the step of 0.5 s.
    jitter: f64,
    /// Whether an hour is missing in the middle, and single frames here and there.
    gaps: bool,
    /// Single frames that are 1000 arcsec off about x.
    spikes: u32,
    /// Whether centroids are written in place of the attitude.
    stars: bool,
}

const PLAIN: Frames = Frames {
    count: 12_000,
    jitter: 0.0,
    gaps: false,
    spikes: 0,
    stars: false,
};

/// The metadata of the page, which renames every column.
fn page() -> Result<String, Box<dyn std::error::Error>> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/fit.md");
    let text = fs::read_to_string(page)?;
    let block = text
        .split("```toml\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next());
    Ok(block.ok_or("the page has an example")?.to_owned())
}

/// Writes a bundle of a slowly turning tracker with the errors of [`TRUTH`].
fn write(dir: &Path, frames: Frames, seed: u64) -> Result<PathBuf, Box<dyn std::error::Error>> {
    let bundle = dir.join("bundle");
    fs::create_dir(&bundle)?;
    fs::write(bundle.join("bundle.toml"), page()?)?;
    let mut random = Random(seed);
    let mut attitude = "TIME,MODE,Q0,Q1,Q2,Q3\n".to_owned();
    let mut stars = "t_s,slot,star_id,x_px,y_px\n".to_owned();
    let mut reference = "TIME,EST_Q0,EST_Q1,EST_Q2,EST_Q3\n".to_owned();
    let start = turn([0.4, -1.1, 0.7]);
    let path = |t: f64| times(turn([2e-5 * t, -3e-6 * t, 1e-6 * t]), start);
    let fov = 512.0 / (PI / 18.0).tan();
    let mut slow: [f64; 3] = [0, 1, 2].map(|axis| TRUTH[axis][0] * random.normal());
    let mut last = 0.0;
    for k in 0..frames.count {
        let mut t = 0.5 * f64::from(k) + 0.5 * frames.jitter * (random.uniform() - 0.5);
        if frames.gaps && k > frames.count / 2 {
            t += 3600.0;
        }
        let mut theta = [0.0; 3];
        for axis in 0..3 {
            let [sigma, tau, white] = TRUTH[axis];
            let a = (-(t - last).max(0.0) / tau).exp();
            slow[axis] = a * slow[axis] + sigma * (1.0 - a * a).sqrt() * random.normal();
            theta[axis] = slow[axis] + white * random.normal() + 150.0;
        }
        last = t;
        if frames.gaps && k % 97 == 13 {
            continue;
        }
        if frames.spikes > 0 && k % (frames.count / frames.spikes) == 7 {
            theta[0] += 1000.0;
        }
        let measured = times(turn(theta.map(|arcsec| arcsec * PI / 648_000.0)), path(t));
        if frames.stars {
            for (slot, [u, v]) in [[0.1, 0.1], [-0.12, 0.05], [0.03, -0.14], [-0.08, -0.1]]
                .into_iter()
                .enumerate()
            {
                // where the star is at the start, in the tracker: carried to now by both attitudes
                let [x, y, z] = seen([u, v, 1.0], start, measured);
                writeln!(
                    stars,
                    "{t:.6},{slot},{},{:.9},{:.9}",
                    slot + 1,
                    fov * x / z,
                    fov * y / z
                )?;
            }
        }
        let [w, x, y, z] = measured;
        writeln!(attitude, "{t:.6},NORMAL,{w:.15},{x:.15},{y:.15},{z:.15}")?;
    }
    let end = last + 1.0;
    let mut t = -1.0;
    while t <= end {
        let [w, x, y, z] = path(t);
        writeln!(reference, "{t:.6},{w:.15},{x:.15},{y:.15},{z:.15}")?;
        t += 0.5;
    }
    if frames.stars {
        let text = fs::read_to_string(bundle.join("bundle.toml"))?;
        let (before, after) = text.split_once("[columns.attitude]").ok_or("renames")?;
        let (_, after) = after.split_once("[columns.reference]").ok_or("renames")?;
        fs::write(
            bundle.join("bundle.toml"),
            format!("{before}[columns.reference]{after}"),
        )?;
        fs::write(bundle.join("stars.csv"), stars)?;
    } else {
        fs::write(bundle.join("attitude.csv"), attitude)?;
    }
    fs::write(bundle.join("reference.csv"), reference)?;
    Ok(bundle)
}

/// A direction `v` of the tracker at attitude `then`, as the tracker at attitude `now` sees it.
fn seen(v: [f64; 3], then: [f64; 4], now: [f64; 4]) -> [f64; 3] {
    let back = times(now, [then[0], -then[1], -then[2], -then[3]]);
    let turned = times(
        times(back, [0.0, v[0], v[1], v[2]]),
        [back[0], -back[1], -back[2], -back[3]],
    );
    [turned[1], turned[2], turned[3]]
}

fn fit(bundle: &Path) -> Result<Value, Box<dyn std::error::Error>> {
    let done = boresight().args(["fit", "--json"]).arg(bundle).output()?;
    assert!(
        done.status.success(),
        "{}",
        String::from_utf8_lossy(&done.stderr)
    );
    assert!(done.stderr.is_empty());
    Ok(serde_json::from_slice(&done.stdout)?)
}

/// `fit BUNDLE --out MODEL.toml`.
fn fit_to(bundle: &Path, model: &Path) -> std::io::Result<Output> {
    boresight()
        .arg("fit")
        .arg(bundle)
        .arg("--out")
        .arg(model)
        .output()
}

/// Every parameter within five of its own standard errors of the truth; white noise, FOGM and cost as
/// the truth has them. The cost is the mean of some 30 squares of unit variance: 1 +- 0.26.
fn holds(report: &Value) -> Done {
    assert_eq!(report["format"], "boresight-fit/1");
    for (axis, truth) in ["x", "y", "z"].into_iter().zip(TRUTH) {
        let found = &report["axes"][axis];
        let names = ["sigma_hsf_arcsec", "tau_hsf_s", "sigma_tn_arcsec"];
        for (name, truth) in names.into_iter().zip(truth) {
            let number = |key: &str| {
                found[name][key]
                    .as_f64()
                    .ok_or_else(|| format!("{axis} {name} {key}"))
            };
            let (value, sigma) = (number("value")?, number("sigma")?);
            assert!(
                (value - truth).abs() < 5.0 * sigma,
                "{axis} {name}: {value} +- {sigma}, truth {truth}"
            );
            assert!(sigma < 0.5 * truth, "{axis} {name}: {sigma} tells nothing");
        }
        assert_eq!(found["preferred"], "fogm_white");
        let cost = found["log_psd_cost"].as_f64().ok_or("cost")?;
        assert!(cost < 2.5, "{axis}: cost {cost}");
    }
    Ok(())
}

#[test]
fn another_programs_bundle_is_fitted() -> Done {
    let dir = tempfile::tempdir()?;
    let report = fit(&write(dir.path(), PLAIN, 1)?)?;
    holds(&report)?;
    // Eq. 17-20 as printed on a raw periodogram: sqrt 2 from the FOGM's side (E6), 0.749 for both (E9).
    // White noise is known to a per cent; 5 % is far from both 1 and 0.749.
    let printed = report["axes"]["x"]["as_printed"]["sigma_tn_arcsec"]
        .as_f64()
        .ok_or("printed")?;
    assert!(
        (printed / (0.749 * TRUTH[0][2]) - 1.0).abs() < 0.05,
        "{printed}"
    );
    Ok(())
}

/// The same truth through gaps, jitter and spikes; the jitter of 60 % of a step leaves no regular run.
#[test]
fn gaps_jitter_and_spikes_change_nothing() -> Done {
    for frames in [
        Frames {
            gaps: true,
            ..PLAIN
        },
        Frames {
            jitter: 0.6,
            gaps: true,
            ..PLAIN
        },
        Frames {
            spikes: 60,
            ..PLAIN
        },
    ] {
        let dir = tempfile::tempdir()?;
        let report = fit(&write(dir.path(), frames, 2)?)?;
        holds(&report)?;
        assert_eq!(report["axes"]["x"]["outliers"], frames.spikes);
        assert_eq!(report["axes"]["y"]["outliers"], 0);
    }
    Ok(())
}

/// Centroids alone: QUEST, with directions from the reference.
#[test]
fn stars_without_attitude_are_solved() -> Done {
    let dir = tempfile::tempdir()?;
    // the stars stay near the middle of the field for 600 s only
    let frames = Frames {
        count: 4000,
        stars: true,
        ..PLAIN
    };
    let report = fit(&write(dir.path(), frames, 3)?)?;
    for (axis, truth) in ["x", "y", "z"].into_iter().zip(TRUTH) {
        let white = report["axes"][axis]["sigma_tn_arcsec"]["value"]
            .as_f64()
            .ok_or("value")?;
        let sigma = report["axes"][axis]["sigma_tn_arcsec"]["sigma"]
            .as_f64()
            .ok_or("sigma")?;
        assert!(
            (white - truth[2]).abs() < 5.0 * sigma,
            "{axis}: {white} +- {sigma}"
        );
    }
    Ok(())
}

/// 100 s of a process of 25 and 60 s: no number, a reason, and a model all the same.
#[test]
fn a_short_span_says_that_it_cannot_tell() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = write(
        dir.path(),
        Frames {
            count: 200,
            ..PLAIN
        },
        4,
    )?;
    let report = fit(&bundle)?;
    let tau = &report["axes"]["y"]["tau_hsf_s"];
    assert!(tau["value"].is_null() && tau["reason"].is_string(), "{tau}");
    let notes = report["notes"].as_array().ok_or("notes")?;
    assert!(
        notes
            .iter()
            .any(|n| n.as_str().is_some_and(|n| n.starts_with("y: tau_HSF")))
    );
    let text = boresight().arg("fit").arg(&bundle).output()?;
    let text = String::from_utf8(text.stdout)?;
    assert!(text.contains("Note      y: tau_HSF"), "{text}");
    assert!(
        text.lines()
            .all(|line| line.chars().count() <= 100 || line.starts_with("Note")),
        "{text}"
    );
    Ok(())
}

#[test]
fn the_model_is_read_again() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = write(dir.path(), PLAIN, 5)?;
    let model = dir.path().join("hem.toml");
    let done = fit_to(&bundle, &model)?;
    assert!(done.status.success() && done.stderr.is_empty());
    let text = fs::read_to_string(&model)?;
    assert!(
        text.contains("kind = \"hem\"") && text.contains("fov_deg = [20, 20]"),
        "{text}"
    );
    assert_eq!(
        fs::read_dir(dir.path())?.count(),
        2,
        "the bundle and the model, nothing else"
    );
    Ok(())
}

/// A tenth of the band less: the white noise stays what it was, known to 1 % either way.
#[test]
fn frequencies_can_be_left_out() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = write(dir.path(), PLAIN, 1)?;
    let plain = fit(&bundle)?;
    let done = boresight()
        .args(["fit", "--json", "--exclude-hz", "0.15,0.25"])
        .arg(&bundle)
        .output()?;
    let left_out: Value = serde_json::from_slice(&done.stdout)?;
    let value = |report: &Value| {
        report["axes"]["x"]["sigma_tn_arcsec"]["value"]
            .as_f64()
            .ok_or("value")
    };
    let (a, b) = (value(&plain)?, value(&left_out)?);
    assert!(
        (a / b - 1.0).abs() < 0.03 && (a - b).abs() > 1e-9,
        "{a} and {b}"
    );
    Ok(())
}

/// Exit 2, one message that names the place, and no file.
#[test]
fn bad_input_leaves_nothing_behind() -> Done {
    type Break = fn(&Path) -> std::io::Result<()>;
    let breaks: [(Break, &[&str]); 4] = [
        (|b| fs::remove_file(b.join("reference.csv")), &["reference"]),
        (
            |b| {
                fs::write(
                    b.join("attitude.csv"),
                    "TIME,Q0,Q1,Q2,Q3\n0.0,1,0,0,0\n0.5,1,zero,0,0\n",
                )
            },
            &["attitude.csv", "line 3", "Q1", "zero"],
        ),
        (
            |b| fs::write(b.join("attitude.csv"), "TIME,Q0,Q1,Q2\n0.0,1,0,0\n"),
            &["attitude.csv", "Q3"],
        ),
        (
            |b| {
                fs::write(
                    b.join("attitude.csv"),
                    "TIME,Q0,Q1,Q2,Q3\n0.0,1,0,0,0\n0.5,1,0,0,0\n",
                )
            },
            &["2 frames", "16"],
        ),
    ];
    for (break_it, words) in breaks {
        let dir = tempfile::tempdir()?;
        let bundle = write(
            dir.path(),
            Frames {
                count: 100,
                ..PLAIN
            },
            6,
        )?;
        break_it(&bundle)?;
        let model = dir.path().join("hem.toml");
        let done = fit_to(&bundle, &model)?;
        let message = String::from_utf8(done.stderr)?;
        assert_eq!(done.status.code(), Some(2), "{message}");
        assert!(done.stdout.is_empty());
        for word in words {
            assert!(message.contains(word), "no {word:?} in: {message}");
        }
        assert_eq!(
            fs::read_dir(dir.path())?.count(),
            1,
            "nothing but the bundle"
        );
    }
    let usage = boresight()
        .args(["fit", "bundle", "--band-hz", "0.2,0.1"])
        .output()?;
    assert_eq!(usage.status.code(), Some(2));
    Ok(())
}

/// The fitted model against the bundle that it was fitted to: every number of the page's table of files is
/// there, the pictures are whole, and the model agrees in every band.
#[test]
fn a_fitted_model_is_compared_with_its_bundle() -> Done {
    let dir = tempfile::tempdir()?;
    let bundle = write(dir.path(), PLAIN, 7)?;
    let (model, out) = (dir.path().join("hem.toml"), dir.path().join("figures"));
    let fitted = fit_to(&bundle, &model)?;
    assert!(fitted.status.success());
    let done = boresight()
        .args(["compare", "--json", "--draws", "40"])
        .args([&model, &bundle])
        .arg("--out")
        .arg(&out)
        .output()?;
    assert!(done.status.success() && done.stderr.is_empty());
    let report: Value = serde_json::from_slice(&done.stdout)?;
    assert_eq!(report["format"], "boresight-compare/1");
    let file = fs::read_to_string(out.join("compare.json"))?;
    assert_eq!(serde_json::from_str::<Value>(&file)?, report);
    for axis in ["x", "y", "z"] {
        let axis = &report["model"]["axes"][axis];
        // the mean of some 35 squares of unit variance: 1 +- 0.3
        let cost = axis["log_psd_cost"].as_f64().ok_or("cost")?;
        assert!((0.2..2.5).contains(&cost), "{cost}");
        for band in axis["bands"].as_array().ok_or("bands")? {
            let (Some(error), Some(sigma)) = (band["error_db"].as_f64(), band["sigma_db"].as_f64())
            else {
                return Err(format!("a band without bins: {band}").into());
            };
            assert!(error.abs() < 5.0 * sigma, "{band}");
        }
    }
    let psd = fs::read_to_string(out.join("psd.csv"))?;
    assert!(psd.starts_with("axis,frequency_hz,dof,measured,mean,upper_3sigma\n"));
    let draws = fs::read_to_string(out.join("draws.csv"))?;
    assert_eq!(draws.lines().count(), psd.lines().count());
    assert_eq!(draws.lines().next().map(|l| l.split(',').count()), Some(42));
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/compare.md");
    let page = fs::read_to_string(page)?;
    for entry in fs::read_dir(&out)? {
        let name = entry?.file_name().into_string().map_err(|_| "a name")?;
        assert!(
            page.contains(&format!("`{name}`")),
            "{name} is not on the page"
        );
        if name.ends_with(".svg") {
            let svg = fs::read_to_string(out.join(&name))?;
            assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n") && !svg.contains("NaN"));
            assert!(
                svg.contains("arcsec") || svg.contains("dB"),
                "{name} has no unit"
            );
        }
    }
    Ok(())
}

/// A model that does not fit, a bundle without reference, too few draws: exit 2, and no folder.
#[test]
fn a_comparison_that_cannot_be_leaves_nothing() -> Done {
    let dir = tempfile::tempdir()?;
    let frames = Frames {
        count: 100,
        ..PLAIN
    };
    let bundle = write(dir.path(), frames, 8)?;
    let (model, out) = (dir.path().join("m.toml"), dir.path().join("figures"));
    fs::write(
        &model,
        "format = \"boresight-model/1\"\nkind = \"pbm\"\n[noise]\ntemporal_arcsec = 5.0\n[[effect]]\nid = \"roling_shutter\"\n",
    )?;
    let run = |draws: &str| {
        boresight()
            .args(["compare", "--draws", draws])
            .args([&model, &bundle])
            .arg("--out")
            .arg(&out)
            .output()
    };
    for (draws, word) in [("8", "rolling_shutter"), ("3", "at least 8")] {
        let done = run(draws)?;
        let message = String::from_utf8(done.stderr)?;
        assert_eq!(done.status.code(), Some(2), "{message}");
        assert!(message.contains(word), "{message}");
        assert!(done.stdout.is_empty() && !out.exists());
    }
    fs::remove_file(bundle.join("reference.csv"))?;
    let done = run("8")?;
    assert_eq!(done.status.code(), Some(2));
    assert!(String::from_utf8(done.stderr)?.contains("reference") && !out.exists());
    Ok(())
}
