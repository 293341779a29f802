//! Each effect alone, at some ten times the standard error of its size: it is named first, with the
//! right size and sign, and the error goes down.
//!
//! Sizes are ten standard errors of these very runs. An honest estimate is off by more than 4 sigma
//! once in 16 000 runs.

use closed_loop::{Questions, close_asking};
use scenarios::simulate;
use telemetry::report::{Report, Selector, Verdict};

use crate::kit::{Case, Path, VELOCITY, closed, named, power, reported};

/// Closes the loop where `id` acts with `lines` (`{}`: its size) and checks what is said of `parameter`.
fn finds(path: Path, id: &str, lines: &str, parameter: &str, size: f64) -> Report {
    let mut case = Case::new(path, 1);
    case.channels = VELOCITY.to_owned();
    let report = case
        .with(id, &lines.replace("{}", &format!("{size:e}")))
        .close()
        .report;
    let first = &report
        .effects
        .first()
        .unwrap_or_else(|| panic!("{id} is missed: {:?}", report.verdict));
    assert_eq!(first.id, id, "{:?}", report.effects);
    let got = &first.parameters[parameter];
    let sigma = got
        .sigma
        .unwrap_or_else(|| panic!("{parameter} has no sigma"));
    let z = (got.value - size) / sigma;
    assert!(
        z.abs() < 4.0,
        "{parameter} = {} +- {sigma}, truth {size}",
        got.value
    );
    // what the declared distortion imitates it takes in any case, at the price that its prior asks
    let [before, after] = [report.before.clone(), report.after.clone()];
    assert!(power(after.star_rms_arcsec) < 1.0005 * power(before.star_rms_arcsec));
    assert!(matches!(
        report.verdict,
        Verdict::Explained | Verdict::PartlyExplained
    ));
    report
}

#[test]
fn rolling_shutter() {
    finds(
        Path::Slews,
        "rolling_shutter",
        "line_time_s = {}",
        "line_time_s",
        1.1e-5,
    );
}

/// Under a steady turn of (90, 130) arcsec/s (X, Y) a row that is exposed later is a shear and a scale: only the
/// prior of the declared distortion tells that it is none. Of its coefficients, of 1.36 arcsec at the edge of
/// 512 px, the shear is half a roll, so that one standard error is 1.36 / (512 sqrt(90^2 / 2 + 130^2)) = 1.8e-5 s.
/// Eight of them, 5.6 with the noise of the stars: found on seeds 1 to 8; where that prior is 2.2 times as wide for
/// all of its modes, on two of these.
#[test]
fn rolling_shutter_beside_a_declared_distortion() {
    finds(
        Path::Scan,
        "rolling_shutter",
        "line_time_s = {}",
        "line_time_s",
        1.5e-4,
    );
}

#[test]
fn time_tag_offset() {
    finds(
        Path::Slews,
        "time_tag_offset",
        "offset_s = {}",
        "offset_s",
        -3.2e-3,
    );
}

/// Stars fall a pixel from where the reference has them, and the declared centroid error is that of
/// another pixel phase: evaluated where it was first thought to act, it leaves one of 4 arcsec behind.
#[test]
fn a_time_tag_offset_of_a_pixel_is_no_pixel_phase_error() {
    let report = finds(
        Path::Turns,
        "time_tag_offset",
        "offset_s = {}",
        "offset_s",
        -0.3,
    );
    assert_eq!(report.effects.len(), 1, "{:?}", report.effects);
}

/// Against the 50 arcsec that such a tag leaves, the declared distortion's prior is a hundred times too
/// tight: what it may not be is shifts of stars and a lens, unless it is weighed against the noise beside
/// the tag.
#[test]
fn beside_a_large_effect_the_declared_distortion_is_what_it_was() {
    for seed in [3, 7, 11] {
        let case = Case::new(Path::Turns, seed).with("time_tag_offset", "offset_s = -0.3");
        let found = case.close().report.effects;
        let ids: Vec<&str> = found.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids, ["time_tag_offset"], "seed {seed}");
    }
}

/// Closes the loop where quiet stars are exposed for `exposure_s`.
fn exposed(path: Path, seed: u64, exposure_s: f64, reference: &str) -> Report {
    let case = Case::new(path, seed)
        .with("exposure_smear", &format!("exposure_s = {exposure_s:?}"))
        .reference(reference);
    reported(&case.quiet(1.0))
}

/// Whether a smear is found first, with its size.
fn is_exposed_for(report: &Report, exposure_s: f64) {
    let first = report.effects.first().expect("something is found");
    assert_eq!(first.id, "exposure_smear");
    let exposure = &first.parameters["exposure_s"];
    let z = (exposure.value - exposure_s) / exposure.sigma.expect("a sigma");
    assert!(z.abs() < 4.0, "{} off by {z} sigma", exposure.value);
}

/// Samples of 1 arcsec twice a second do not tell how a sway of five seconds and 30 arcsec accelerates, a gyro
/// does. Without it nothing is named, and the acceleration is told as what is left.
#[test]
fn a_smear_is_found_by_the_gyro() {
    let without = "rates = false\nwhite_arcsec = [1.0, 1.0, 1.0]\n";
    let gyro = "[rates]\nwhite_arcsec_s = [0.3, 0.3, 0.3]\nbias_arcsec_s = [1.0, -2.0, 0.5]\n";
    let report = exposed(Path::Sways, 1, 1.5, &format!("{without}{gyro}"));
    is_exposed_for(&report, 1.5);
    assert_eq!(report.verdict, Verdict::Explained);
    let report = exposed(Path::Sways, 1, 1.5, without);
    assert!(report.effects.is_empty());
    assert_eq!(report.unattributed.depends_on[0].variable, "acceleration");
}

/// An exposure longer than a step, against samples of 0.3 arcsec: the path of the frame itself tells the smear. That of the
/// next frame holds the error of this one, and the smear lost to a description by the acceleration.
#[test]
fn a_smear_longer_than_a_step_follows_the_path_of_its_frame() {
    let reference = "rates = false\nwhite_arcsec = [0.3, 0.3, 0.3]\n";
    let report = exposed(Path::Turns, 1, 0.7, reference);
    is_exposed_for(&report, 0.7);
    assert_eq!(report.verdict, Verdict::Explained);
}

/// A reference that wanders by 0.5 arcsec over 100 s, with white noise of its own or without. Along a path through its
/// attitudes the wander's own changes are among the accelerations, and a smear by these is not believed; along that
/// less the wander that the stars tell it is, with its size, and nothing is left.
#[test]
fn a_smear_is_found_beside_a_wander() {
    for (seed, white) in [(1, 0.0), (2, 0.0), (3, 0.1)] {
        let reference = format!(
            "rates = false\nwhite_arcsec = [{white:?}, {white:?}, {white:?}]\nwander_arcsec = [0.5, 0.5, 0.5]\n"
        );
        let report = exposed(Path::Turns, seed, 0.6, &reference);
        is_exposed_for(&report, 0.6);
        let ids: Vec<&str> = report.effects.iter().map(|e| e.id.as_str()).collect();
        assert_eq!(ids, ["exposure_smear", "reference_error"], "{seed} {white}");
        assert_eq!(report.verdict, Verdict::Explained, "{seed} {white}");
    }
}

/// Where such a wander is all that accelerates, no size of a smear is told: the path is not the camera's.
#[test]
fn a_wander_alone_tells_no_smear() {
    for (path, seen) in [(Path::Drift, false), (Path::Turns, true)] {
        let case = Case::new(path, 1).reference("rates = false\nwander_arcsec = [0.5, 0.5, 0.5]\n");
        let scenario = case.quiet(1.0);
        let bundle = simulate(&scenario).unwrap();
        let asked = Questions::about(["exposure_smear"]).unwrap();
        let closed = close_asking(&scenario.model_without_effects(), &bundle, &asked, &|_| {});
        let report = closed.unwrap().report;
        assert_eq!(report.hypotheses[0].observable, seen);
        let smear = report.considered.iter().find(|c| c.id == "exposure_smear");
        let smear = smear.expect("it is not named");
        let told = [
            smear.observable,
            smear.detectable.is_some(),
            smear.against.is_none(),
        ];
        assert_eq!(told, [seen; 3], "{smear:?}");
    }
}

/// Nods beside such a wander, and a step in the middle.
fn stepped(seed: u64) -> Report {
    let lines = "at_s = 230.0\nx_arcsec = 2.0\ny_arcsec = -2.0\nz_arcsec = 3.0";
    let case = Case::new(Path::Nods, seed).with("step_misalignment", lines);
    let reference = "rates = false\nwander_arcsec = [0.5, 0.5, 0.5]\n";
    reported(&case.reference(reference).quiet(1.0))
}

/// The fold that it is in is predicted with what the levels before and after tell of it. Beside the innovations there, which
/// know the fold before them, other folds told steps of -0.7 and -0.7 arcsec for 2.0 and -2.0, and it was refused, for the
/// error grew.
#[test]
fn a_step_is_predicted_across_the_fold_that_it_is_in() {
    let report = stepped(3040);
    assert_eq!(named(&report), ["step_misalignment", "reference_error"]);
    let [before, after] = [&report.before, &report.after].map(|e| power(e.star_rms_arcsec));
    // here the wander goes against it
    assert!(after < 0.95 * before, "{before} {after}");
    assert!(!report.unattributed.present);
}

/// A step in the middle of such a run, beside such a wander. With the noise known, generalised least squares tells its
/// parts about X and Y to 0.14 arcsec and that about Z to 0.33; four correlation times tell the wander's size, and with
/// it these errors, to a factor of 1.6. Beside the likeliest noise they were 0.18 and 0.16 about Z.
#[test]
fn a_step_beside_a_wander_is_as_well_known_as_it_is_said_to_be() {
    for seed in [3, 11] {
        let report = stepped(seed);
        assert_eq!(
            named(&report),
            ["step_misalignment", "reference_error"],
            "{seed}"
        );
        let known = [
            ("x_arcsec", 2.0, 0.14),
            ("y_arcsec", -2.0, 0.14),
            ("z_arcsec", 3.0, 0.33),
        ];
        for (part, size, error) in known {
            let got = &report.effects[0].parameters[part];
            let sigma = got.sigma.unwrap_or(f64::INFINITY);
            assert!(
                (0.6..1.6).contains(&(sigma / error)),
                "{seed}, {part}: {got:?}"
            );
            assert!(
                (got.value - size).abs() < 4.0 * sigma,
                "{seed}, {part}: {got:?}"
            );
        }
    }
}

#[test]
fn focal_length_with_a_temperature() {
    let lines = "channel = \"optics_c\"\nppm_per_c = {}";
    finds(Path::Drift, "focal_length_drift", lines, "ppm_per_c", 42.0);
}

#[test]
fn focal_length_with_time() {
    finds(
        Path::Drift,
        "focal_length_drift",
        "ppm_per_s = {}",
        "ppm_per_s",
        -0.15,
    );
}

#[test]
fn chromatic_shift() {
    finds(
        Path::Slews,
        "chromatic_shift",
        "ppm_per_mag = {}",
        "ppm_per_mag",
        80.0,
    );
}

#[test]
fn bending_with_a_temperature() {
    let lines = "channel = \"bracket_c\"\nx_arcsec_per_unit = {}\ny_arcsec_per_unit = 0.0\nz_arcsec_per_unit = 0.0";
    finds(
        Path::Drift,
        "thermal_misalignment",
        lines,
        "x_arcsec_per_unit",
        -1.7,
    );
    let lagging = format!("lag_s = 30.0\n{lines}");
    finds(
        Path::Drift,
        "thermal_misalignment",
        &lagging,
        "x_arcsec_per_unit",
        2.2,
    );
}

/// Another part of the bench leads the optics by 40 degrees of their cycle: alike by cos 40 = 0.77 over whole cycles, and
/// by more once it lags. What the one bends by is told beside the other.
#[test]
fn a_channel_like_another_is_told() {
    let mut case = Case::new(Path::Drift, 1);
    case.channels = "[[housekeeping.channel]]\nkind = \"sinusoid\"\nname = \"mount_c\"\nmean = 15.0\namplitude = 0.8\n\
        period_s = 300.0\nphase_deg = 80.0\nnoise = 0.02\n"
        .to_owned();
    let lines = "channel = \"optics_c\"\nx_arcsec_per_unit = 2.5\ny_arcsec_per_unit = 0.0\nz_arcsec_per_unit = 0.0";
    let report = case.with("thermal_misalignment", lines).close().report;
    let first = &report.effects[0];
    let channel = |name: &str| Selector::Text(name.to_owned());
    assert_eq!(first.id, "thermal_misalignment");
    assert_eq!(first.selectors["channel"], channel("optics_c"));
    let others = first.confusable_with.iter();
    let mut same = others.filter(|c| c.id == first.id);
    let other = same.next().expect("the other channel");
    assert_eq!(other.selectors["channel"], channel("mount_c"));
    assert!(
        other.correlation > 0.77 && other.correlation < 1.0,
        "{other:?}"
    );
    assert!(other.delta_loglik > Some(0.0) && other.delta_loglik < Some(first.delta_loglik));
    assert!(same.next().is_none(), "the channel itself is no other");
    let text = &other.manoeuvre.as_ref().expect("a motion").text;
    assert!(
        text.contains("thermal_misalignment of channel = mount_c"),
        "{text}"
    );
}

#[test]
fn exposure_smear() {
    finds(
        Path::Turns,
        "exposure_smear",
        "exposure_s = {}",
        "exposure_s",
        0.29,
    );
}

#[test]
fn step() {
    let lines = "at_s = 211.3\nx_arcsec = {}\ny_arcsec = 0.0\nz_arcsec = 0.0";
    finds(Path::Drift, "step_misalignment", lines, "x_arcsec", 1.2);
}

/// A step of 100 arcsec, 19 sigma of a row, two thirds on: what stands out of most stars of frame after frame is no
/// outlier, of attitudes neither.
#[test]
fn a_step_beyond_outliers() {
    let lines = "at_s = 350.3\nx_arcsec = 100.0\ny_arcsec = -60.0\nz_arcsec = 0.0";
    let case = Case::new(Path::Drift, 60).with("step_misalignment", lines);
    let duration_s = case.duration_s;
    let (model, mut bundle) = case.make();
    for stars in [true, false] {
        if !stars {
            bundle.stars = None;
        }
        let report = closed(&model, &bundle).expect("the loop closes").report;
        assert_eq!(named(&report), ["step_misalignment"], "{stars}");
        // the last fold, which alone sees what comes after, is held against nothing, the four others against what
        // that shifts their mean by; noise of the attitudes of some 5 arcsec adds 0.6 %
        let rms = report.before.attitude_rms_arcsec.expect("attitudes")[0];
        let after = 1.0 - 350.3 / duration_s;
        let known = 100.0 * (after + after * after / 0.8).sqrt();
        assert!((rms / known - 1.0).abs() < 0.03, "{stars}: {rms}, {known}");
        let got = &report.effects[0].parameters["x_arcsec"];
        assert!(
            (got.value - 100.0).abs() < 4.0 * got.sigma.unwrap(),
            "{stars}: {got:?}"
        );
    }
}

/// A step of six and a half standard errors (x 5.3, y 3.8) in white noise is a step, not a reference that
/// wanders: expected of 95 in 100, fewer than 6 of 8 once in 200. Its instant lies within its bounds of
/// 95 %: outside more than 3 of 8 times once in 6000.
#[test]
fn a_faint_step_is_a_step() {
    let (mut steps, mut inside) = (0, 0);
    for seed in 0..8 {
        let mut case = Case::new(Path::Still, 40 + seed);
        case.duration_s = 600.0;
        let report = case
            .with(
                "step_misalignment",
                "at_s = 250.3\nx_arcsec = 0.465\ny_arcsec = -0.335\nz_arcsec = 0.0",
            )
            .close()
            .report;
        let Some(first) = report.effects.first() else {
            continue;
        };
        if first.id == "step_misalignment" {
            steps += 1;
            let [low, high] = first.parameters["at_s"].interval.unwrap();
            inside += usize::from((low..=high).contains(&250.3));
        }
    }
    assert!(steps >= 6, "{steps} of 8");
    assert!(inside + 3 >= steps, "{inside} of {steps} within");
}

/// The same case where nobody declares an exposure.
fn undeclared(exposure_s: f64) -> Report {
    let case =
        Case::new(Path::Turns, 5).with("exposure_smear", &format!("exposure_s = {exposure_s:?}"));
    let (mut model, mut bundle) = case.make();
    model.tracker.exposure_s = None;
    bundle.meta.tracker.exposure_s = None;
    closed(&model, &bundle).expect("the loop closes").report
}

/// An exposure that nobody declared may be of any length up to 2 s: its square is not held against that of
/// 0.1 s. Beyond, it is said why it is not named.
#[test]
fn a_long_exposure_that_nobody_declared() {
    let report = undeclared(0.9);
    let got = &report.effects[0].parameters["exposure_s"];
    let sigma = got.sigma.unwrap();
    assert_eq!(report.effects[0].id, "exposure_smear");
    assert!((got.value - 0.9).abs() < 4.0 * sigma, "{got:?}");
    let report = undeclared(2.6);
    assert!(report.effects.iter().all(|e| e.id != "exposure_smear"));
    let considered = report.considered.iter().find(|c| c.id == "exposure_smear");
    let refused = considered.and_then(|c| c.refused.clone()).unwrap();
    assert_eq!(refused.parameter, "exposure_s");
    assert!((2.3..2.9).contains(&refused.value), "{refused:?}");
    assert!((refused.believed[1] - 2.0).abs() < 1e-9, "{refused:?}");
}

/// Warm pixels that sixty others are visited longer than, in three fifths of the run and more, are looked at
/// like any other; the pull of each, all pixels paid for, is named with its place, of two that no star is near at
/// once as of one.
#[test]
fn warm_pixels_that_are_visited_no_longer_than_others() {
    for count in [1, 2] {
        warm_pixels_are_named(count);
    }
}

fn warm_pixels_are_named(count: usize) {
    let mut case = Case::new(Path::Nods, 7);
    case.duration_s = 1200.0;
    let (_, bundle) = case.make();
    let stars = bundle.stars.as_ref().expect("it has some");
    let mut visits = std::collections::BTreeMap::<[i32; 2], Vec<usize>>::new();
    for frame in 0..stars.frames() {
        for row in stars.rows_of(frame) {
            #[expect(clippy::cast_possible_truncation, reason = "within the detector")]
            let pixel = [stars.x_px[row], stars.y_px[row]].map(|p| p.floor() as i32);
            visits.entry(pixel).or_default().push(frame);
        }
    }
    let fifth = stars.frames().div_ceil(5);
    let mut pixels: Vec<_> = visits.into_iter().collect();
    pixels.sort_by_key(|(pixel, frames)| (std::cmp::Reverse(frames.len()), *pixel));
    let often = |frames: &Vec<usize>| {
        let fifths: std::collections::BTreeSet<_> = frames.iter().map(|f| f / fifth).collect();
        fifths.len() >= 3
    };
    let mut warm: Vec<[f64; 2]> = Vec::new();
    for (pixel, _) in pixels.iter().skip(60).filter(|(_, f)| often(f)) {
        let [x, y] = pixel.map(|p| f64::from(p) + 0.5);
        let apart = |at: &[f64; 2]| (at[0] - x).abs().max((at[1] - y).abs()) > 10.0;
        if warm.len() < count && warm.iter().all(apart) {
            warm.push([x, y]);
            let lines = format!("x_px = {x:?}\ny_px = {y:?}\nstrength = 0.06");
            case = case.with("hot_pixel", &lines);
        }
    }
    assert_eq!(warm.len(), count, "such pixels");
    let report = case.close().report;
    assert_eq!(report.effects.len(), count, "{:?}", report.effects);
    for effect in &report.effects {
        let of = |name: &str| effect.parameters[name].value;
        assert_eq!(effect.id, "hot_pixel");
        let there = |at: &[f64; 2]| (of("x_px") - at[0]).hypot(of("y_px") - at[1]) < 1e-9;
        assert!(warm.iter().any(there), "{effect:?} of {warm:?}");
        let sigma = effect.parameters["strength"].sigma.expect("it has one");
        assert!((of("strength") - 0.06).abs() < 4.0 * sigma, "{effect:?}");
    }
}

/// A heater that bends the camera by 0.36 arcsec at most, of 16 and 26 nats, in two of fourteen draws that a slow error of
/// the reference explains as well, though not beyond doubt: what then follows the channel is the heater's.
#[test]
fn a_heater_is_no_slow_error_that_goes_with_its_channel() {
    let lines = "channel = \"optics_c\"\nx_arcsec_per_unit = 0.0\ny_arcsec_per_unit = 0.45\nz_arcsec_per_unit = 0.0";
    for seed in [7007, 7009] {
        let mut case = Case::new(Path::Drift, seed);
        case.duration_s = 500.0;
        let report = case.with("thermal_misalignment", lines).close().report;
        assert_eq!(named(&report), ["thermal_misalignment"], "seed {seed}");
        let channel = &report.effects[0].selectors["channel"];
        assert_eq!(*channel, Selector::Text("optics_c".to_owned()));
        assert!(!report.unattributed.present, "seed {seed}");
    }
}

/// Optics that one channel bends and stretches, of 15 to 45 nats each: either stands by itself, and the channel as one term
/// pays once for what these pay for twice. (So it had refused 6 of 100 draws.)
#[test]
fn what_a_channel_bends_and_stretches_is_two_effects() {
    let bend = "channel = \"optics_c\"\nx_arcsec_per_unit = 0.0\ny_arcsec_per_unit = 0.65\nz_arcsec_per_unit = 0.0";
    let stretch = "channel = \"optics_c\"\nppm_per_c = 18.0";
    for seed in [7375, 7384, 7385] {
        let mut case = Case::new(Path::Drift, seed);
        case.duration_s = 500.0;
        let case = case.with("thermal_misalignment", bend);
        let report = case.with("focal_length_drift", stretch).close().report;
        let mut effects = named(&report);
        effects.sort_unstable();
        let both = ["focal_length_drift", "thermal_misalignment"];
        assert_eq!(effects, both, "seed {seed}");
        assert!(!report.unattributed.present, "seed {seed}");
    }
}
