//! References with holes, or with noise larger than the motion: what they still tell is used.

use closed_loop::Closed;
use telemetry::Bundle;

use crate::kit::{Case, Path, closed};

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
