//! `report.html`: well-formed, whole for each kind of bundle, and true to `report.json`.

use std::collections::{BTreeMap, BTreeSet};

use closed_loop::{Closed, Rival};
use focal_plane::Camera;
use report::{Run, html};
use serde_json::Value;
use telemetry::report::{
    Confusable, ConsideredEffect, Dependence, Errors, Estimate, FoundEffect, Hypothesis,
    HypothesisSize, Manoeuvre, REPORT_FORMAT, Report, Rows, Selector, Unattributed, Verdict,
};
use telemetry::{AttitudeResiduals, Bundle, DarkMap, Model, StarResiduals};

use well_formed::well_formed;

mod well_formed;

/// Text that must not get through as markup.
const HOSTILE: &str = "<b>&\"'\u{1}</title><script>alert(1)</script>";

/// Uniform numbers from −0.5 to 0.5.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        ((self.0 >> 11) as f64) / (1_u64 << 53) as f64 - 0.5
    }

    /// A row of residuals `size` wide; `after` is a tenth of `before`.
    fn push(&mut self, size: f64, before: &mut [Vec<f64>], after: &mut [Vec<f64>]) {
        for (before, after) in before.iter_mut().zip(after) {
            let value = size * self.next();
            before.push(value);
            after.push(0.1 * value);
        }
    }
}

/// Ten stars over `frames` frames that drift over the detector.
fn star_rows(frames: u32) -> StarResiduals {
    let mut noise = Noise(1);
    let mut rows = StarResiduals::default();
    for k in 0..frames {
        for star in 0..10_i32 {
            let drift = f64::from(k) / f64::from(frames);
            rows.t_s.push(0.5 * f64::from(k));
            rows.slot.push(star);
            rows.star_id.push(1000 + i64::from(star));
            rows.x_px
                .push(100.0 * f64::from(star) - 480.0 + 60.0 * drift);
            rows.y_px
                .push(90.0 * f64::from(9 - star) - 400.0 + 80.0 * drift);
            noise.push(8.0, &mut rows.before_arcsec, &mut rows.after_arcsec);
            rows.fold.push(5 * k / frames);
            rows.outlier.push(false);
        }
    }
    rows
}

fn attitude_rows(frames: u32) -> AttitudeResiduals {
    let mut noise = Noise(2);
    let mut rows = AttitudeResiduals::default();
    for k in 0..frames {
        rows.t_s.push(2.0 * f64::from(k));
        noise.push(3.0, &mut rows.before_arcsec, &mut rows.after_arcsec);
        rows.fold.push(5 * k / frames);
        rows.outlier.push(false);
    }
    rows
}

fn estimate(value: f64, sigma: Option<f64>, interval: Option<[f64; 2]>) -> Estimate {
    Estimate {
        value,
        sigma,
        unit: format!("s {HOSTILE}"),
        interval,
    }
}

/// A report in which every text is hostile, and every number has its place.
fn findings(stars: bool, attitude: bool) -> Report {
    let errors = |size: f64| Errors {
        star_rms_arcsec: stars.then_some([2.31 * size, 2.29 * size]),
        attitude_rms_arcsec: attitude.then_some([0.87 * size, 0.86 * size, 0.85 * size]),
        log_psd_cost: None,
        chi2_per_dof: stars.then_some(1.75 * size),
        loglik_per_frame: Some(-12.5 / size),
    };
    let effect = |id: &str| FoundEffect {
        id: id.to_owned(),
        selectors: BTreeMap::from([("channel".to_owned(), Selector::Text(HOSTILE.to_owned()))]),
        parameters: BTreeMap::from([
            (
                "line/time~s".to_owned(),
                estimate(3.02e-5, Some(1.1e-6), None),
            ),
            (
                "at_s".to_owned(),
                estimate(812.5, None, Some([801.0, 830.25])),
            ),
            (HOSTILE.to_owned(), estimate(-4.0, None, None)),
        ]),
        delta_loglik: 264.4,
        p_value: 2.4e-33,
        variance_explained: Some(0.0415),
        confusable_with: vec![Confusable {
            id: HOSTILE.to_owned(),
            selectors: BTreeMap::from([("channel".to_owned(), Selector::Text(HOSTILE.to_owned()))]),
            correlation: -0.31,
            delta_loglik: Some(12.5),
            separation_sigma: Some(4.25),
            manoeuvre: Some(Manoeuvre {
                kind: "slew".to_owned(),
                axis: [0.0, 0.0, 1.0],
                rate_deg_s: 0.2,
                duration_s: 60.0,
                ramp_s: 12.0,
                sigma: 5.625,
                text: HOSTILE.to_owned(),
            }),
        }],
    };
    let tried = |id: &str, observable: bool| ConsideredEffect {
        selectors: BTreeMap::new(),
        against: None,
        id: id.to_owned(),
        delta_loglik: observable.then_some(-0.42),
        p_value: observable.then_some(0.71),
        observable,
        detectable: observable.then_some(0.05),
        needed: observable.then_some(0.93),
        parameter: Some(HOSTILE.to_owned()),
        unit: Some(HOSTILE.to_owned()),
        refused: None,
    };
    Report {
        format: REPORT_FORMAT.to_owned(),
        verdict: Verdict::PartlyExplained,
        folds: 5,
        rows: Rows {
            used: 9873,
            outliers: 12,
            outside_reference: 58,
        },
        windows: None,
        before: errors(1.0),
        after: errors(0.1),
        effects: vec![effect("rolling_shutter"), effect(HOSTILE)],
        considered: vec![
            tried("time_tag_offset", true),
            tried(HOSTILE, true),
            tried("hot_pixel", false),
        ],
        hypotheses: vec![Hypothesis {
            id: "exposure_smear".to_owned(),
            observable: true,
            sizes: vec![HypothesisSize {
                parameter: HOSTILE.to_owned(),
                unit: HOSTILE.to_owned(),
                value: Some(0.0625),
                detectable: Some(0.53),
                ..HypothesisSize::default()
            }],
            variance_share_at_most: Some(0.0123),
            finding: HOSTILE.to_owned(),
            ..Hypothesis::default()
        }],
        unattributed: Unattributed {
            present: true,
            variance_fraction: Some(0.017),
            depends_on: follows(&format!("housekeeping:{HOSTILE}"), 0.21, 3e-4),
            lines_hz: vec![0.0123, 0.31],
            jumps_s: vec![1234.5, 2345.5],
            noise_depends_on: follows("time", 0.33, 2e-7),
            shared_noise_depends_on: follows("rate", 0.44, 3e-8),
        },
    }
}

fn follows(variable: &str, variance_explained: f64, p_value: f64) -> Vec<Dependence> {
    vec![Dependence {
        variable: variable.to_owned(),
        variance_explained,
        p_value,
    }]
}

fn closed(stars: Option<StarResiduals>, attitude: Option<AttitudeResiduals>) -> Closed {
    let axes = if stars.is_some() { 2 } else { 3 };
    Closed {
        report: findings(stars.is_some(), attitude.is_some()),
        model: Model {
            title: Some(HOSTILE.to_owned()),
            ..Model::default()
        },
        stars,
        attitude,
        dark_map: None,
        rivals: vec![Rival {
            what: HOSTILE.to_owned(),
            rms_arcsec: vec![0.5; axes],
            delta_loglik: 17.0,
        }],
    }
}

fn bundle() -> Bundle {
    let mut bundle = Bundle {
        camera: Camera::from_focal_length_px([1024, 1024], 2903.7).ok(),
        ..Bundle::default()
    };
    bundle.meta.title = Some(HOSTILE.to_owned());
    bundle.meta.source = Some(HOSTILE.to_owned());
    bundle
}

fn dark_map() -> DarkMap {
    let side = 8;
    let pixels = || (0..side * side).map(|k| (k % side, k / side));
    DarkMap {
        x_px: pixels().map(|p| f64::from(p.0)).collect(),
        y_px: pixels().map(|p| f64::from(p.1)).collect(),
        dn: pixels().map(|p| f64::from(p.0 * p.1)).collect(),
        sigma_dn: vec![2.0; 64],
    }
}

fn page(closed: &Closed) -> String {
    html(&Run {
        closed,
        bundle: &bundle(),
        input: HOSTILE,
        compared: Err(HOSTILE),
    })
}

/// The three kinds of bundle, by name.
fn kinds() -> Vec<(&'static str, Closed)> {
    let mut images = closed(Some(star_rows(200)), None);
    images.dark_map = Some(dark_map());
    vec![
        ("stars with images", images),
        ("attitude", closed(None, Some(attitude_rows(400)))),
        (
            "stars and attitude",
            closed(Some(star_rows(200)), Some(attitude_rows(400))),
        ),
    ]
}

#[test]
fn every_kind_has_its_sections_and_is_well_formed() {
    let always = [
        "verdict",
        "numbers",
        "spectrum",
        "models",
        "time",
        "effects",
        "apart",
        "hypotheses",
        "rivals",
        "considered",
        "leftover",
        "rows",
        "model",
        "reading",
    ];
    for (name, closed) in kinds() {
        let page = page(&closed);
        assert_eq!(well_formed(&page), Ok(()), "{name}");
        let mut wanted: BTreeSet<&str> = always.into();
        if closed.stars.is_some() {
            wanted.extend(["field", "phase"]);
        }
        if closed.dark_map.is_some() {
            wanted.insert("dark-map");
        }
        let ids: Vec<&str> = page
            .split("<section id=\"")
            .skip(1)
            .filter_map(|s| s.split('"').next())
            .collect();
        assert_eq!(
            ids[..2],
            ["verdict", "numbers"],
            "{name}: what counts comes first"
        );
        assert_eq!(ids.len(), wanted.len(), "{name}: {ids:?}");
        assert_eq!(ids.into_iter().collect::<BTreeSet<_>>(), wanted, "{name}");
        assert!(!page.contains("NaN") && !page.contains("inf\""), "{name}");
    }
}

/// The table of the documentation names the sections in their order.
#[test]
fn the_documentation_names_every_section() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats/report.md");
    let text = std::fs::read_to_string(path).unwrap_or_default();
    let table = text.split("## `report.html`").nth(1).unwrap_or_default();
    let named: Vec<&str> = table
        .split("\n## ")
        .next()
        .unwrap_or_default()
        .lines()
        .filter_map(|line| line.strip_prefix("| `")?.split('`').next())
        .collect();
    let (_, mut all) = kinds().remove(2);
    all.dark_map = Some(dark_map());
    let page = page(&all);
    let sections = page.split("<section id=\"").skip(1);
    let there: Vec<&str> = sections.filter_map(|s| s.split('"').next()).collect();
    assert_eq!(there, named);
}

/// A picture has a title for those who cannot see it that states a number, units, and a caption.
#[test]
fn every_picture_says_something() {
    for (name, closed) in kinds() {
        let page = page(&closed);
        let figures: Vec<&str> = page.split("<figure>").skip(1).collect();
        let least = 1
            + usize::from(closed.stars.is_some()) * 3
            + usize::from(closed.attitude.is_some())
            + usize::from(closed.dark_map.is_some());
        assert_eq!(figures.len(), least, "{name}");
        for figure in figures {
            let figure = figure.split("</figure>").next().unwrap_or_default();
            let between = |from: &str, to: &str| {
                let rest = figure.split(from).nth(1).unwrap_or_default();
                rest.split(to).next().unwrap_or_default().to_owned()
            };
            let title = between("<title>", "</title>");
            assert!(figure.contains("role=\"img\""), "{name}: {title}");
            assert!(
                title.contains(|c: char| c.is_ascii_digit()),
                "{name}: {title:?}"
            );
            assert!(
                between("<figcaption>", "</figcaption>").len() > 40,
                "{name}: {title}"
            );
            let unit = [
                "residual, arcsec<",
                "mean, key ",
                "arcsec²/Hz<",
                "level, DN<",
            ];
            assert!(
                unit.iter().any(|u| figure.contains(u)),
                "{name}: no unit, {title}"
            );
            let legend = [">before", "mean, key ", "level, DN<"];
            assert!(
                legend.iter().any(|u| figure.contains(u)),
                "{name}: no legend, {title}"
            );
        }
    }
}

#[test]
fn nothing_is_loaded_and_nothing_runs() {
    for (name, closed) in kinds() {
        let page = page(&closed)
            .replace("xmlns=\"http://www.w3.org/1999/xhtml\"", "")
            .replace("xmlns=\"http://www.w3.org/2000/svg\"", "");
        for never in [
            "http",
            "//",
            "href",
            "src=",
            "url(",
            "@import",
            "<script",
            "<link",
            "<iframe",
            "<object",
            "javascript",
            "onload",
        ] {
            assert!(!page.contains(never), "{name}: {never}");
        }
    }
}

#[test]
fn text_of_users_is_no_markup() {
    for (name, closed) in kinds() {
        let page = page(&closed);
        assert!(
            !page.contains("<b>") && !page.contains("alert(1)</script>"),
            "{name}"
        );
        let safe = "&lt;b&gt;&amp;&quot;&#39; &lt;/title&gt;";
        assert!(page.contains(&format!("<title>{safe}")), "{name}");
        assert!(page.contains(&format!("<h1>{safe}")), "{name}");
        // title, input, source, model, why, effect, selector, parameter, unit, rivals, tried, follows
        let places = page.matches("&lt;b&gt;&amp;").count();
        assert!(places >= 20, "{name}: {places}");
    }
}

#[test]
fn a_chance_below_all_numbers_is_no_markup() {
    for (name, mut closed) in kinds() {
        let effects = &mut closed.report.effects;
        effects.iter_mut().for_each(|e| e.p_value = 0.0);
        well_formed(&page(&closed)).unwrap_or_else(|why| panic!("{name}: {why}"));
    }
}

/// The finite numbers of a JSON value with their pointers.
fn numbers(at: &str, value: &Value, out: &mut BTreeMap<String, f64>) {
    match value {
        Value::Number(n) => {
            out.extend(n.as_f64().map(|n| (at.to_owned(), n)));
        }
        Value::Array(list) => {
            for (k, v) in list.iter().enumerate() {
                numbers(&format!("{at}/{k}"), v, out);
            }
        }
        Value::Object(map) => {
            for (k, v) in map {
                let key = k.replace('~', "~0").replace('/', "~1");
                numbers(&format!("{at}/{key}"), v, out);
            }
        }
        _ => {}
    }
}

fn unescaped(text: &str) -> String {
    let all = [
        ("&lt;", "<"),
        ("&gt;", ">"),
        ("&quot;", "\""),
        ("&#39;", "'"),
        ("&amp;", "&"),
    ];
    all.iter()
        .fold(text.to_owned(), |text, (from, to)| text.replace(from, to))
}

/// Every number of `report.json` stands on the page with exactly its value, and no other number claims to.
#[test]
fn the_numbers_are_those_of_the_json() {
    for (name, closed) in kinds() {
        let json = serde_json::to_value(&closed.report).unwrap_or_default();
        let mut wanted = BTreeMap::new();
        numbers("", &json, &mut wanted);
        assert!(wanted.len() > 40, "{name}");
        let page = page(&closed);
        let mut shown = BTreeMap::new();
        for piece in page.split("<data value=\"").skip(1) {
            let mut parts = piece.split('"');
            let value: f64 = parts.next().unwrap_or_default().parse().unwrap_or(f64::NAN);
            let key = unescaped(parts.nth(1).unwrap_or_default());
            // a control character of a name has no way onto the page
            shown.insert(key.replace(' ', "\u{1}"), value);
        }
        for (key, value) in &wanted {
            let there = shown.remove(key).map(f64::to_bits);
            assert_eq!(there, Some(value.to_bits()), "{name}: {key} = {value}");
        }
        assert!(shown.is_empty(), "{name}: {shown:?}");
    }
}

/// What a person reads is that number, rounded.
#[test]
fn people_read_rounded_numbers() {
    let (_, closed) = kinds().remove(0);
    let page = page(&closed);
    for (key, shown) in [
        ("/before/star_rms_arcsec/0", "2.31"),
        ("/after/star_rms_arcsec/1", "0.229"),
        ("/effects/0/p_value", "2.4 × 10⁻³³"),
        ("/effects/0/variance_explained", "4.15"),
        (
            "/effects/0/parameters/line~1time~0s/value",
            "(3.02 ± 0.11) × 10⁻⁵",
        ),
        ("/unattributed/lines_hz/0", "12.3 mHz"),
    ] {
        let text = format!("data-key=\"{key}\">{shown}<");
        assert!(page.contains(&text), "{text}");
    }
    assert!(page.contains("−90.0 %"));
    // 0.93 is needed, 0.05 shows at 5 sigma
    assert!(page.contains("that would show at 93.0σ"));
}

/// After is a tenth of before: 20 dB in every band, whatever the window. A row marked as an outlier
/// changes no title.
#[test]
fn titles_state_what_is_drawn() {
    let titles = |closed: &Closed| -> Vec<String> {
        let page = page(closed);
        let svgs = page.split("<svg xmlns").skip(1);
        svgs.filter_map(|s| s.split("<title>").nth(1)?.split("</title>").next())
            .map(str::to_owned)
            .collect()
    };
    for (name, mut closed) in kinds() {
        let clean = titles(&closed);
        let axes = if closed.attitude.is_some() { 3 } else { 2 };
        let fall = vec!["−20.0"; axes].join(", ");
        assert_eq!(clean[0].matches(&fall).count(), 3, "{name}: {}", clean[0]);
        if let Some(stars) = &mut closed.stars {
            let row = 777;
            stars.outlier[row] = true;
            stars.before_arcsec[0][row] = 1e5;
            stars.after_arcsec[1][row] = -1e6;
        }
        if let Some(attitude) = &mut closed.attitude {
            attitude.outlier[77] = true;
            attitude.after_arcsec[2][77] = 1e6;
        }
        for (a, b) in clean.iter().zip(titles(&closed)) {
            assert!(
                b.len() < a.len() + 8 && !b.contains("10⁵") && !b.contains("10⁶"),
                "{b}"
            );
            // what one row less of many does to a number is below its third digit, or near it
            let first = |t: &str| -> f64 {
                let number = t
                    .split(' ')
                    .find_map(|w| w.trim_end_matches(',').parse().ok());
                number.unwrap_or(0.0)
            };
            assert!(
                (first(a) - first(&b)).abs() <= 0.2 * first(a).abs(),
                "{a} | {b}"
            );
        }
    }
}

/// Stars that rest at pixel centres, with noise alone. Sorted by where they are expected all rows fall
/// into one bin, whose mean is within five of its sigmas: 5 * 8 / sqrt(12 * 2000) = 0.26 arcsec. Sorted by
/// where they were measured the bins beside it would hold nothing but rows of one sign, 3 arcsec off.
#[test]
fn noise_makes_no_pattern_over_pixel_phase() {
    let mut rows = star_rows(200);
    let scale = bundle().camera.map_or(f64::NAN, |c| c.arcsec_per_px()[0]);
    for r in 0..rows.t_s.len() {
        let centre = 40.0 * f64::from(rows.slot[r]) - 180.5;
        rows.x_px[r] = centre + rows.before_arcsec[0][r] / scale;
    }
    let mut closed = closed(Some(rows), None);
    closed.report.effects.clear();
    let page = page(&closed);
    let title = page
        .split("The rms over pixel phase is ")
        .nth(1)
        .unwrap_or_default();
    let rms: f64 = title
        .split(' ')
        .next()
        .and_then(|w| w.parse().ok())
        .unwrap_or(f64::NAN);
    assert!(rms < 0.26, "{rms}");
}

/// Where nothing was added there is no before and after, and the page says so.
#[test]
fn a_consistent_bundle_shows_one_residual() {
    for (name, mut closed) in kinds() {
        closed.report.effects.clear();
        closed.report.unattributed.present = false;
        closed.report.verdict = Verdict::Consistent;
        let page = page(&closed);
        assert_eq!(well_formed(&page), Ok(()), "{name}");
        assert!(page.contains("Consistent: the data follows the declared model"));
        assert!(page.contains(">measured"), "{name}");
        for text in [">after, ", ">after ±", ", after<", "goes from"] {
            assert!(!page.contains(text), "{name}: {text}");
        }
    }
}

/// Snapshots have no spectrum, a frame or two no pictures worth the name: still a page.
#[test]
fn short_series_make_a_page() {
    for frames in [1, 2, 9] {
        for closed in [
            closed(Some(star_rows(frames)), None),
            closed(None, Some(attitude_rows(frames))),
        ] {
            let page = page(&closed);
            assert_eq!(well_formed(&page), Ok(()), "{frames}");
            assert!(!page.contains("NaN"), "{frames}");
        }
    }
}

/// 200 000 star rows and 60 000 attitudes, and a dark map of as many pixels: below a megabyte.
#[test]
fn a_large_bundle_makes_a_small_page() {
    let mut large = closed(Some(star_rows(20_000)), Some(attitude_rows(60_000)));
    let side = 200;
    let pixels = || (0..side * side).map(|k| (5 * (k % side) - 500, 5 * (k / side) - 500));
    large.dark_map = Some(DarkMap {
        x_px: pixels().map(|p| f64::from(p.0)).collect(),
        y_px: pixels().map(|p| f64::from(p.1)).collect(),
        dn: pixels().map(|p| f64::from(p.0 % 7)).collect(),
        sigma_dn: vec![1.0; 40_000],
    });
    let page = page(&large);
    assert_eq!(well_formed(&page), Ok(()));
    assert!(page.len() < 1_000_000, "{}", page.len());
}
