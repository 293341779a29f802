//! Stars that hardly move, and each errs by a constant of its own.

use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use scenarios::simulate;
use telemetry::report::{Report, Verdict};

use crate::kit::{Case, Path, closed, named};

/// Noise of a centroid, circular, arcsec.
const NOISE: f64 = 0.5;

/// Stars alone that a camera at rest looks at for seven minutes, each off by a constant of `sigmas` of a row's noise
/// along each axis; what else acts is in `case`.
fn seen(case: &Case, sigmas: f64) -> Report {
    let scenario = case.clone().reference("none").quiet(NOISE);
    let mut bundle = simulate(&scenario).expect("a bundle");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(case.seed);
    let camera = scenario.model.camera().expect("a camera");
    let camera = camera.expect("a focal length");
    let px = sigmas * NOISE / 2.0_f64.sqrt() / camera.arcsec_per_px()[0];
    let stars = bundle.stars.as_mut().expect("stars");
    let mut ids = stars.star_id.clone();
    ids.sort_unstable();
    ids.dedup();
    let normal = |rng: &mut Xoshiro256PlusPlus| -> f64 { StandardNormal.sample(rng) };
    let off: Vec<[f64; 2]> = ids
        .iter()
        .map(|_| [0, 1].map(|_| px * normal(&mut rng)))
        .collect();
    for row in 0..stars.star_id.len() {
        let own = ids.binary_search(&stars.star_id[row]).expect("a star");
        stars.x_px[row] += off[own][0];
        stars.y_px[row] += off[own][1];
    }
    let model = scenario.model_without_effects();
    closed(&model, &bundle).expect("the loop closes").report
}

/// Of eight stars there are thirteen numbers, which nine parameters of a lens and eight waves of a pixel phase explain
/// whatever they are.
#[test]
fn constants_of_stars_are_no_effect() {
    for (stars, sigmas, seeds) in [
        (8, 0.5, 0..2),
        (8, 5.0, 0..2),
        (20, 5.0, 0..1),
        (40, 5.0, 1..2),
    ] {
        for seed in seeds {
            let mut case = Case::new(Path::Rest, 8100 + seed);
            case.stars = stars;
            let report = seen(&case, sigmas);
            let what = format!("{stars} stars of {sigmas} sigma, seed {seed}");
            assert_eq!(named(&report), Vec::<&str>::new(), "{what}");
            assert_eq!(report.verdict, Verdict::Unexplained, "{what}");
            let first = report.unattributed.depends_on.first();
            assert_eq!(first.map(|d| d.variable.as_str()), Some("star"), "{what}");
        }
    }
}

/// All stars agree on a lens that shifts them by tens of times what each errs by itself.
#[test]
fn what_stars_at_rest_agree_on_is_named() {
    for sigmas in [0.0, 0.5] {
        let mut case = Case::new(Path::Rest, 8200).with("optical_distortion", "k1 = 2e-3");
        case.stars = 14;
        let report = seen(&case, sigmas);
        assert_eq!(named(&report), ["optical_distortion"], "{sigmas}");
        let left = report.unattributed.depends_on.first();
        let left = left.filter(|_| report.unattributed.present);
        let own = (sigmas > 0.0).then_some("star");
        assert_eq!(left.map(|d| d.variable.as_str()), own, "{sigmas}");
    }
}
