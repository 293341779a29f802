//! References and frames with holes, samples that are far apart or near, noise larger than the motion: what there is
//! is used.

use closed_loop::Closed;
use telemetry::Bundle;

use crate::kit::{Case, Path, closed, kept_of};

/// Takes the rates and every sample in `hole` from the reference.
fn with_holes(bundle: &mut Bundle, hole: impl Fn(f64) -> bool) {
    let reference = bundle.reference.as_mut().expect("a reference");
    reference.rates_rad_s = None;
    let kept: Vec<bool> = reference.t_s.iter().map(|&t| !hole(t)).collect();
    let mut at = kept.iter();
    reference.t_s.retain(|_| *at.next().expect("one for each"));
    let mut at = kept.iter();
    reference.q.retain(|_| *at.next().expect("one for each"));
}

fn run(case: &Case, hole: impl Fn(f64) -> bool) -> Closed {
    let (model, mut bundle) = case.make();
    with_holes(&mut bundle, hole);
    closed(&model, &bundle).expect("the loop closes")
}

fn names(closed: &Closed) -> Vec<&str> {
    let found = &closed.report.effects;
    found.iter().map(|e| e.id.as_str()).collect()
}

/// Slews of up to 300 arcsec/s, two holes across which the tracker has turned by up to a degree.
#[test]
fn a_hole_does_not_hide_the_motion_elsewhere() {
    let case = Case::new(Path::Slews, 5)
        .reference("white_arcsec = [0.2, 0.2, 0.2]")
        .with("time_tag_offset", "offset_s = 0.012");
    let closed = run(&case, |t| {
        (100.2..133.0).contains(&t) || (300.2..320.0).contains(&t)
    });
    assert_eq!(names(&closed), ["time_tag_offset"]);
    let offset = &closed.report.effects[0].parameters["offset_s"];
    let sigma = offset.sigma.expect("a sigma");
    assert!(
        (offset.value - 0.012).abs() < 5.0 * sigma && sigma < 2e-3,
        "{offset:?}"
    );
}

/// Under a steady drift a time tag is a misalignment. Frames at the ends and beside holes (a quarter of
/// them) see the same motion as all: were they taken for frames without one, 0.07 s would have shown.
#[test]
fn beside_a_hole_the_tracker_moves_too() {
    let case = Case::new(Path::Drift, 5).with("time_tag_offset", "offset_s = 0.3");
    let closed = run(&case, |t| t % 12.0 > 8.2);
    assert!(closed.report.effects.is_empty(), "{:?}", names(&closed));
    let tag = closed
        .report
        .considered
        .iter()
        .find(|c| c.id == "time_tag_offset")
        .expect("it was considered");
    assert!(tag.detectable.is_none_or(|s| s > 3.0), "{tag:?}");
}

/// At rest, beside a reference whose noise is ten times what the tracker turns by between samples:
/// aberration needs the attitude alone.
#[test]
fn what_needs_the_attitude_alone_does_without_the_motion() {
    let mut case = Case::new(Path::Still, 5)
        .reference("white_arcsec = [0.5, 0.5, 0.5]")
        .with("velocity_aberration", "scale = 1.0");
    case.duration_s = 900.0;
    case.channels = "[[housekeeping.channel]]\nkind = \"orbit_velocity\"\nradius_km = 6928.0\n\
         period_s = 5739.0\ninclination_deg = 51.6\n"
        .to_owned();
    let closed = run(&case, |_| false);
    assert_eq!(names(&closed), ["velocity_aberration"]);
    let tag = closed
        .report
        .considered
        .iter()
        .find(|c| c.id == "time_tag_offset");
    assert!(tag.is_some_and(|t| !t.observable), "{tag:?}");
}

/// Three frames in ten are missing, or from the middle on nine in ten, and there is no reference: swings of 59 and 81 s
/// go on across what is missing, no row is set aside for it, and a rolling shutter is found as with all.
#[test]
fn missing_frames_take_no_others_along() {
    // of three in ten, without a pattern
    let random = |k: usize| (k * 7919 + k * k * 31) % 10 >= 3;
    let slower = |k: usize| k < 420 || k.is_multiple_of(10);
    let kept: [&dyn Fn(usize) -> bool; 2] = [&random, &slower];
    for kept in kept {
        let mut case = Case::new(Path::Nods, 5).reference("none");
        case = case.with("rolling_shutter", "line_time_s = 3e-4");
        let (model, mut bundle) = case.make();
        let frames = kept_of(bundle.stars.as_ref().expect("stars"), kept, |_, _| true);
        let rows = frames.star_id.len();
        bundle.stars = Some(frames);
        let closed = closed(&model, &bundle).expect("the loop closes");
        let told = &closed.report.rows;
        // the last frames have neighbours on one side alone
        assert!(told.outside_reference <= rows / 100, "{told:?} of {rows}");
        assert_eq!(names(&closed), ["rolling_shutter"]);
        let line = &closed.report.effects[0].parameters["line_time_s"];
        let z = (line.value - 3e-4) / line.sigma.unwrap_or(f64::NAN);
        assert!(z.abs() < 4.0, "{line:?}");
    }
}

/// Frames every four seconds beside a reference at 10 Hz: forty samples from one to the next.
#[test]
fn frames_far_apart_know_their_motion() {
    let case = Case::new(Path::Nods, 6)
        .reference("rate_hz = 10.0\nrates = false")
        .with("time_tag_offset", "offset_s = 0.05");
    let (model, mut bundle) = case.make();
    let frames = kept_of(
        bundle.stars.as_ref().expect("stars"),
        |k| k.is_multiple_of(8),
        |_, _| true,
    );
    bundle.stars = Some(frames);
    let closed = closed(&model, &bundle).expect("the loop closes");
    assert_eq!(names(&closed), ["time_tag_offset"]);
    let offset = &closed.report.effects[0].parameters["offset_s"];
    let z = (offset.value - 0.05) / offset.sigma.unwrap_or(f64::NAN);
    assert!(z.abs() < 4.0, "{offset:?}");
}
