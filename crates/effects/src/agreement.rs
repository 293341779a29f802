//! Every effect of the catalogue, forward against regressors and through its own description.
//!
//! Not physics: tests of the physics in the other files.

use focal_plane::{ARCSEC_PER_RAD, Pixel};
use nalgebra::{DMatrix, Matrix6, Vector3, Vector6};
use star_tracker::{Disturbance, Pbm, TemporalNoise};

use crate::harness::{Bench, Sway, as_given};
use crate::{
    Candidate, EffectError, FrameGeometry, Parameters, Surroundings, VectorFrame, WarmPixels,
    build, catalogue, free_orbit, harmonics_of, hot_pixel_at, kind, line_at, nearest_circles,
    reported, step_at,
};

fn candidates(bench: &Bench, id: &str) -> Vec<Box<dyn Candidate>> {
    let warm = bench.with_star_rows(|rows| {
        let n = rows.len();
        let nothing = vec![0.0; n];
        WarmPixels::look(&bench.camera, rows, [&nothing, &nothing], &vec![1.0; n])
    });
    kind(id).unwrap().candidates(&bench.scene(Some(&warm)))
}

/// A third of the plausible size of each coefficient, of either sign where it may have one.
fn a_third(candidate: &dyn Candidate) -> Vec<f64> {
    candidate
        .coefficients()
        .iter()
        .zip([1.0, -0.7, 0.4].into_iter().cycle())
        .map(|(c, sign)| c.plausible / 3.0 * f64::max(sign, c.lower))
        .collect()
}

/// Users look up there what their models may declare.
#[test]
fn every_effect_has_its_line_on_the_page() {
    let page = include_str!("../../../docs/effects.md");
    let listed = page.lines().filter(|line| line.starts_with("| `")).count();
    assert_eq!(listed, catalogue().len());
    for kind in catalogue() {
        assert!(
            page.contains(&format!("\n| `{}` |", kind.id())),
            "{}",
            kind.id()
        );
    }
}

/// Shifts of the image, the attitude and the direction.
#[test]
fn columns_are_the_derivative_of_the_forward_action() {
    let bench = Bench::new();
    for id in [
        "thermal_misalignment",
        "step_misalignment",
        "periodic_misalignment",
        "time_tag_offset",
        "rolling_shutter",
        "velocity_aberration",
        "focal_length_drift",
        "chromatic_shift",
        "catalogue_position",
        "optical_distortion",
    ] {
        let all = candidates(&bench, id);
        assert!(!all.is_empty(), "{id} has candidates");
        for candidate in all {
            bench.stars_agree(candidate.as_ref(), &a_third(candidate.as_ref()));
        }
    }
}

/// The columns of a smear are taken about 0.4 s; at another exposure they miss the fourth order,
/// P'''' (T^4 - T^2 T0^2)/1920: with motions of 0.11 rad/s and 150 px that is 1e-4 of the second.
#[test]
fn smear_grows_with_the_square_of_the_exposure() {
    let bench = Bench::with(Sway { amplitude: 0.1 });
    let candidate = candidates(&bench, "exposure_smear").remove(0);
    bench.stars_agree_refined(candidate.as_ref(), &[0.16], 1e-9);
    // 2 s instead of 0.4 s: refined, the columns are those of 2 s
    bench.stars_agree_refined(candidate.as_ref(), &[4.0], 1e-9);
    let effect = candidate.realise(&[4.0], &bench.surroundings()).unwrap();
    assert!((effect.parameters()[0].value - 2.0).abs() < 1e-15);
    assert!(candidate.realise(&[-1.0], &bench.surroundings()).is_err());
}

/// Substituted columns leave the rounding of the path; the shutter's three substitutions shrink its
/// error by `line_time |v_y|` < 1e-4 * 13 each, from 0.65 px, to 1e-9.
#[test]
fn shifts_in_time_are_exact_once_refined() {
    let bench = Bench::new();
    let offset = candidates(&bench, "time_tag_offset").remove(0);
    bench.stars_agree_refined(offset.as_ref(), &[1.3], 1e-9);
    let shutter = candidates(&bench, "rolling_shutter").remove(0);
    bench.stars_agree_refined(shutter.as_ref(), &[1e-4], 1e-8);
}

/// Shifts at the centroid stage are the same function of the same place: nothing is left but rounding.
#[test]
fn centroid_effects_agree_to_rounding() {
    let bench = Bench::new();
    for orders in [&[1][..], &[2], &[3], &[4], &[1, 2, 3, 4]] {
        let candidate = harmonics_of(&bench.camera, orders);
        bench.stars_agree(candidate.as_ref(), &a_third(candidate.as_ref()));
    }
    let under = bench.with_star_rows(|rows| rows.at(7));
    let candidate = hot_pixel_at(Pixel {
        x: under.x + 0.8,
        y: under.y - 1.1,
    });
    bench.stars_agree(candidate.as_ref(), &[0.05]);
}

#[test]
fn hot_pixels_are_proposed_where_stars_dwell() {
    let bench = Bench::with(Sway { amplitude: 0.0 });
    let all = candidates(&bench, "hot_pixel");
    assert_eq!(all.len(), 12, "twelve stars at rest are over twelve pixels");
    for candidate in all {
        bench.stars_agree(candidate.as_ref(), &[0.05]);
    }
}

/// Against the truth, a misalignment is the attitude error itself: in the full model QUEST returns it
/// to rounding. 1e-13 rad: QUEST's own 1e-15 over the eigenvalue gap of this field, 0.02.
#[test]
fn misalignments_are_attitude_errors() {
    let bench = Bench::new();
    for id in [
        "thermal_misalignment",
        "step_misalignment",
        "periodic_misalignment",
    ] {
        for candidate in candidates(&bench, id) {
            let [got, left] =
                bench.attitude_error(candidate.as_ref(), &a_third(candidate.as_ref()));
            // two small rotations at right angles: theta^2 of 1e-5 rad
            assert!(
                got > 1e-6 && left < 1e-12,
                "{candidate:?}: {left} of {got} rad"
            );
        }
    }
}

/// The error of a time tag is -offset omega to first order; the chord leaves rounding.
#[test]
fn a_late_time_tag_turns_the_attitude_against_the_rate() {
    let bench = Bench::new();
    let candidate = candidates(&bench, "time_tag_offset").remove(0);
    // second order: offset^2 |dw/dt| / 2, |dw/dt| < 0.05 (0.11^2 + 0.07^2 + 0.05^2) + 3e-5 = 1e-3
    let [got, left] = bench.attitude_error(candidate.as_ref(), &[0.01]);
    assert!(got > 3e-5 && left < 5e-8, "{left} of {got} rad");
    let refined = candidate.refined(&[1.0]).unwrap();
    let [got, left] = bench.attitude_error(refined.as_ref(), &[1.0]);
    assert!(got > 3e-3 && left < 1e-12, "{left} of {got} rad");
}

/// A tracker that ignores aberration errs by z x v/c. Stars off the boresight by an angle a (0.08 rms
/// here, not quite symmetric) add terms of the order a v/c, most of them in roll: the roll of a field
/// is fixed 1/a times worse, so its error may reach v/c times the asymmetry of the field.
#[test]
fn an_uncorrected_tracker_errs_by_boresight_cross_velocity() {
    let mut bench = Bench::with(Sway { amplitude: 1e-4 });
    bench.frames = Some(frames(VectorFrame::Inertial, None));
    let candidate = candidates(&bench, "velocity_aberration").remove(0);
    let [got, left] = bench.attitude_error(candidate.as_ref(), &[1.0]);
    // 26 km/s, two thirds of it across the boresight: 6e-5 rad = 12 arcsec
    assert!(got * ARCSEC_PER_RAD > 8.0, "{got}");
    assert!(left < 0.1 * got, "{left} of {got} rad");
}

/// An orbit that turns once in 200 s, as a fit without the law of circles would tell it.
fn circle() -> Box<dyn Candidate> {
    let (span_s, values) = ([0.0, 120.0], [3000.0, 0.0, 4000.0, 0.0, 5000.0, 0.0].into());
    let mut nearest = nearest_circles(200.0, span_s, &values, &Matrix6::identity(), 1);
    nearest.swap_remove(0).1
}

/// The first column of an orbit is all of it, to rounding of positions; of an attitude, as with channels, but for
/// terms of the field's asymmetry.
#[test]
fn an_orbit_moves_stars_as_its_speed_says() {
    let bench = Bench::with(Sway { amplitude: 1e-4 });
    let values = [5000.0, 0.0, 0.0, 0.0, 0.0];
    bench.stars_agree(circle().as_ref(), &values);
    let [got, left] = bench.attitude_error(circle().as_ref(), &values);
    assert!(
        got * ARCSEC_PER_RAD > 2.0 && left < 0.1 * got,
        "{left} of {got} rad"
    );
}

fn frames(vectors_in: VectorFrame, quaternion_signs: Option<[f64; 3]>) -> FrameGeometry {
    let cameras = vectors_in == VectorFrame::Body;
    FrameGeometry {
        tracker_boresight: cameras.then(|| Vector3::new(-0.587_785, 0.0, 0.809_017)),
        reference_boresight: cameras.then(|| Vector3::new(0.587_785, 0.0, 0.809_017)),
        vectors_in,
        quaternion_signs,
    }
}

#[test]
fn vectors_in_tracker_axes_move_stars_directly() {
    let mut bench = Bench::new();
    bench.frames = Some(frames(VectorFrame::Tracker, None));
    let candidate = candidates(&bench, "velocity_aberration").remove(0);
    bench.stars_agree(candidate.as_ref(), &[1.0]);
}

/// Between two cameras, whichever way the axes of their quaternions point.
#[test]
fn between_two_cameras_only_the_difference_shows() {
    let mut bench = Bench::new();
    bench.frames = Some(frames(VectorFrame::Body, None));
    let all = candidates(&bench, "velocity_aberration");
    // the arm lies along x: nothing can show on x, and on y and z each sign is +, - or not claimed
    let signs = |candidate: &dyn Candidate| candidate.selectors()["quaternion_signs"].clone();
    let patterns: Vec<String> = all.iter().map(|c| signs(c.as_ref())).collect();
    assert_eq!(patterns, ["00+", "0+-", "0+0", "0++"]);
    assert_eq!(
        all.iter().map(|c| c.choices()).collect::<Vec<_>>(),
        [1, 2, 1, 2]
    );
    for candidate in &all {
        bench.stars_agree(candidate.as_ref(), &[1.0]);
        let [got, left] = bench.attitude_error(candidate.as_ref(), &[1.0]);
        assert!(got > 1e-5 && left < 1e-12, "{left} of {got} rad");
    }
    // a negative scale turns the signs round
    let turned = all[1].realise(&[-0.9], &bench.surroundings()).unwrap();
    assert_eq!(turned.selectors()["quaternion_signs"], "0-+");
    assert!((turned.parameters()[0].value - 0.9).abs() < 1e-15);
    bench.frames = Some(frames(VectorFrame::Body, Some([1.0, 1.0, 1.0])));
    assert_eq!(
        candidates(&bench, "velocity_aberration").len(),
        1,
        "known signs leave one"
    );
}

/// What an effect says of itself builds it again: the same shift to rounding.
#[test]
fn every_description_builds_the_same_effect_again() {
    let bench = Bench::new();
    let mut all: Vec<Box<dyn Candidate>> = Vec::new();
    for kind in catalogue() {
        all.extend(candidates(&bench, kind.id()));
    }
    all.push(step_at(40.0, [0.0, 120.0], 1));
    all.push(line_at(0.0123, [0.0, 120.0], 1));
    // the phase counts from the middle of data this late
    all.push(line_at(0.0123, [500.0, 620.0], 1));
    all.push(circle());
    all.push(free_orbit(200.0, [0.0, 120.0]));
    assert!(all.len() > 60);
    for candidate in all {
        let values = a_third(candidate.as_ref());
        let surroundings = bench.surroundings();
        let effect = candidate.realise(&values, &surroundings).unwrap();
        let again = build(effect.id(), &as_given(effect.as_ref()), &surroundings).unwrap();
        assert_eq!(effect.selectors(), again.selectors());
        for (a, b) in effect.parameters().iter().zip(again.parameters()) {
            assert_eq!((&a.name, a.unit), (&b.name, b.unit));
            assert!((a.value - b.value).abs() <= 1e-12 * a.value.abs());
        }
        let pbm = |effect: Box<dyn crate::Effect>| {
            Pbm::new(bench.camera.clone()).with_disturbance(effect as Box<dyn Disturbance>)
        };
        let (first, second) = (bench.forward(&pbm(effect)), bench.forward(&pbm(again)));
        for (a, b) in first.iter().zip(second) {
            assert!((a - b).abs() < 1e-9, "{candidate:?}: {a} {b}");
        }
    }
}

#[test]
fn ids_are_those_of_the_documentation() {
    let got: Vec<&str> = catalogue().iter().map(|kind| kind.id()).collect();
    let mut sorted = got.clone();
    sorted.sort_unstable();
    sorted.dedup();
    assert_eq!(sorted.len(), got.len(), "no id twice");
    for kind in catalogue() {
        assert!(!kind.summary().is_empty() && !kind.needs().is_empty());
        let on = kind.acts_on();
        assert!(
            on.images || on.stars || on.attitude || on.noise,
            "{} acts on something",
            kind.id()
        );
    }
}

/// Each kind refuses a name that it does not have, and images have nothing to build.
#[test]
fn a_misspelt_parameter_is_an_error_everywhere() {
    let bench = Bench::new();
    let given = Parameters::from([("no_such_parameter".to_owned(), 1.0.into())]);
    for kind in catalogue() {
        let error = kind.build(&given, &bench.surroundings()).unwrap_err();
        match kind.acts_on().images {
            true => assert_eq!(error, EffectError::ActsOnImages { effect: kind.id() }),
            false => {
                assert!(
                    matches!(error, EffectError::UnknownParameter { .. }),
                    "{}: {error}",
                    kind.id()
                );
            }
        }
    }
}

#[test]
fn channels_belong_to_their_effects() {
    let bench = Bench::new();
    for (id, channels) in [
        ("thermal_misalignment", vec!["ccd_temp_c", "heater_on"]),
        ("focal_length_drift", vec!["ccd_temp_c"]),
    ] {
        let mut got: Vec<String> = candidates(&bench, id)
            .iter()
            .filter_map(|c| c.selectors().get("channel").cloned())
            .collect();
        got.dedup();
        assert_eq!(got, channels, "{id}");
    }
    let given = |channel: &str| {
        Parameters::from([
            ("channel".to_owned(), channel.into()),
            ("x_arcsec_per_unit".to_owned(), 1.0.into()),
        ])
    };
    let build = |channel: &str| {
        build(
            "thermal_misalignment",
            &given(channel),
            &bench.surroundings(),
        )
    };
    assert!(matches!(
        build("vx_km_s"),
        Err(EffectError::WrongChannel { .. })
    ));
    assert!(matches!(
        build("mirror_c"),
        Err(EffectError::NoChannel { .. })
    ));
}

/// Without what an effect needs there are no candidates.
#[test]
fn candidates_need_what_they_act_on() {
    let bench = Bench::new();
    let mut scene = bench.scene(None);
    scene.has_reference = false;
    scene.has_catalogue = false;
    for id in [
        "thermal_misalignment",
        "step_misalignment",
        "periodic_misalignment",
        "catalogue_position",
    ] {
        assert!(kind(id).unwrap().candidates(&scene).is_empty(), "{id}");
    }
    let none = std::collections::BTreeMap::new();
    scene.surroundings = Surroundings {
        channels: &none,
        ..scene.surroundings
    };
    assert!(
        kind("velocity_aberration")
            .unwrap()
            .candidates(&scene)
            .is_empty()
    );
}

/// Measured minus noise-free of star `slot` in x, arcsec, over `seeds` runs of the bench.
fn noise_of(bench: &Bench, pbm: &Pbm, slot: usize, seeds: u64) -> Vec<f64> {
    (0..seeds)
        .flat_map(|seed| bench.noise_x_arcsec(pbm, slot, seed))
        .collect()
}

/// A variance from n normals has relative standard deviation sqrt(2/n).
#[test]
fn noise_effects_scale_sigma() {
    let bench = Bench::with(Sway { amplitude: 0.0 });
    let given = |name: &str, value: f64| Parameters::from([(name.to_owned(), value.into())]);
    let base =
        Pbm::new(bench.camera.clone()).with_noise(TemporalNoise::per_axis_arcsec(3.0).unwrap());
    let with = |id: &str, given: &Parameters| {
        let effect = build(id, given, &bench.surroundings()).unwrap();
        base.clone()
            .with_disturbance(effect as Box<dyn Disturbance>)
    };
    let faint = with("magnitude_noise", &given("slope", 1.0));
    for slot in [0, 11] {
        // star s has magnitude 2 + 0.3 s
        let theory = 3.0 * 10_f64.powf(0.2 * (2.0 + 0.3 * slot as f64 - 5.0));
        let noise = noise_of(&bench, &faint, slot, 40);
        let variance = noise.iter().map(|e| e * e).sum::<f64>() / noise.len() as f64;
        let z = (variance / (theory * theory) - 1.0) / (2.0 / noise.len() as f64).sqrt();
        assert!(z.abs() < 5.0, "star {slot}: {z} sigma");
    }
    // at rest the rate adds nothing
    let still = with("rate_noise", &given("arcsec_per_deg_s", 40.0));
    let (a, b) = (
        noise_of(&bench, &still, 3, 1),
        noise_of(&bench, &base, 3, 1),
    );
    assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9));
}

/// The share of rows with a spike is binomial, and spikes leave the temporal noise as it was.
#[test]
fn spikes_come_at_their_rate() {
    let bench = Bench::with(Sway { amplitude: 0.0 });
    let given = Parameters::from([
        ("rate".to_owned(), 0.05.into()),
        ("size_arcsec".to_owned(), 500.0.into()),
    ]);
    let effect = build("outliers", &given, &bench.surroundings()).unwrap();
    let pbm = Pbm::new(bench.camera.clone()).with_disturbance(effect as Box<dyn Disturbance>);
    let noise = noise_of(&bench, &pbm, 5, 100);
    let spikes: Vec<f64> = noise.iter().copied().filter(|e| e.abs() > 1e-6).collect();
    let n = noise.len() as f64;
    let z = (spikes.len() as f64 - 0.05 * n) / (n * 0.05 * 0.95).sqrt();
    assert!(
        z.abs() < 5.0,
        "{} spikes in {n} rows: {z} sigma",
        spikes.len()
    );
    let variance = spikes.iter().map(|e| e * e).sum::<f64>() / spikes.len() as f64;
    let z = (variance / 250_000.0 - 1.0) / (2.0 / spikes.len() as f64).sqrt();
    assert!(z.abs() < 5.0, "size {}: {z} sigma", variance.sqrt());
}

#[test]
fn the_reference_wanders_by_itself() {
    let bench = Bench::new();
    let given = Parameters::from([
        ("sigma_x_arcsec".to_owned(), 2.0.into()),
        ("tau_x_s".to_owned(), 30.0.into()),
    ]);
    let effect = build("reference_error", &given, &bench.surroundings()).unwrap();
    let wander = effect.reference_wander().unwrap();
    assert!((wander.sigma_arcsec[0] - 2.0).abs() < 1e-15 && wander.sigma_arcsec[1] == 0.0);
    assert_eq!(effect.parameters().len(), 2);
}

/// A cosine and a sine of 3 and 4 with sigma 0.1 each are an amplitude of 5 with sigma 0.1 and a phase
/// with sigma 0.1/5; differences of a hundredth of a sigma are good to (0.001/5)^2 of that.
#[test]
fn uncertainty_goes_through_to_the_reported_parameters() {
    let bench = Bench::new();
    let candidate = harmonics_of(&bench.camera, &[1]);
    let covariance = DMatrix::from_diagonal_element(4, 4, 0.01);
    let values = [3.0, 4.0, 1.0, 0.0];
    let got = reported(
        candidate.as_ref(),
        &values,
        covariance.as_view(),
        &bench.surroundings(),
    )
    .unwrap();
    let expected = [
        (5.0, 0.1),
        (4.0_f64.atan2(3.0), 0.02),
        (1.0, 0.1),
        (0.0, 0.1),
    ];
    for ((parameter, sigma), (value, spread)) in got.iter().zip(expected) {
        assert!((parameter.value - value).abs() < 1e-12, "{parameter:?}");
        assert!(
            (sigma - spread).abs() < 1e-5 * spread,
            "{parameter:?}: {sigma}"
        );
    }
}

/// Turning an orbit about the pole changes its node and nothing else: its sigma is the same where the node passes from
/// 360 degrees to 0.
#[test]
fn a_node_near_zero_is_known_as_well_as_any() {
    let bench = Bench::new();
    let sigmas: Vec<f64> = (0..360)
        .step_by(10)
        .map(|turn| {
            let (s, c) = f64::from(turn).to_radians().sin_cos();
            let turned = |[x, y, z]: [f64; 3]| [c * x - s * y, s * x + c * y, z];
            let both = [turned([3000.0, 0.0, 4000.0]), turned([0.0, 5000.0, 0.0])];
            let values = Vector6::from_iterator(both.into_iter().flatten());
            let span_s = [0.0, 120.0];
            let nearest = nearest_circles(200.0, span_s, &values, &Matrix6::identity(), 1);
            let orbit = &nearest[0].1;
            let covariance = DMatrix::from_diagonal_element(5, 5, 1e4);
            let values = [5000.0, 0.0, 0.0, 0.0, 0.0];
            let surroundings = bench.surroundings();
            let told = reported(orbit.as_ref(), &values, covariance.as_view(), &surroundings);
            let told = told.unwrap();
            let node = told.iter().find(|(p, _)| p.name == "node_deg");
            node.expect("an orbit has one").1
        })
        .collect();
    // 100 m/s of 5000, by the sine of the inclination
    assert!((0.5..5.0).contains(&sigmas[0]), "{sigmas:?}");
    for sigma in &sigmas {
        assert!((sigma - sigmas[0]).abs() < 1e-3 * sigmas[0], "{sigmas:?}");
    }
}
