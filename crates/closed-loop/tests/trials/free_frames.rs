//! Pictures of the sky whose attitudes are their own, by cameras that a first solution gets wrong.

use focal_plane::Catalogue;
use nalgebra::Vector3;
use telemetry::report::{Report, Verdict};
use telemetry::{Bundle, EffectEntry, EffectValue};

use crate::kit::{Case, Path, closed, named, reported};
use crate::snapshots::{Lens, arcsec, pictures, taken};

/// A wide field: some forty stars of 150 in 80 deg.
fn wide(k1: f64) -> Lens {
    Lens {
        k1,
        fov_deg: 80.0,
        stars: 300,
        ..Lens::default()
    }
}

/// Chi-squared per degree of freedom scatters by `sqrt(2/n)` of n numbers, two a row less three a frame.
fn is_noise(chi2: Option<f64>, report: &Report, frames: usize) {
    let numbers = 2.0 * report.rows.used as f64 - 3.0 * frames as f64;
    let chi2 = chi2.expect("chi-squared");
    assert!(
        (chi2 - 1.0).abs() < 5.0 * (2.0 / numbers).sqrt(),
        "{chi2} of {numbers}"
    );
}

/// One star in 25 is another, hundreds of pixels off: it takes the first attitude of its picture along by ten
/// and more, whose square is pixels at the edge of the field. Set aside, it is a spike and leaves no other trace; those
/// that fall out of the field are none.
#[test]
fn stars_taken_for_others_are_spikes_alone() {
    let lens = Lens {
        mistaken: Some(25),
        off_px: 500.0,
        ..Lens::default()
    };
    let report = pictures(5, 30, lens);
    assert_eq!(named(&report), ["outliers"]);
    assert!(report.rows.outliers > 10, "{:?}", report.rows);
    let rate = &report.effects[0].parameters["rate"];
    let share = report.rows.outliers as f64 / (report.rows.used + report.rows.outliers) as f64;
    let z = (rate.value - share) / rate.sigma.expect("a sigma");
    assert!(z.abs() < 1.0, "{rate:?} of {share}, the same rows");
    is_noise(report.before.chi2_per_dof, &report, 30);
}

/// What the model declares of a lens that bends by thirty pixels is all of it.
#[test]
fn a_declared_lens_is_taken_off() {
    let (mut model, bundle) = taken(6, 20, wide(-0.08));
    let parameters = [("k1".to_owned(), EffectValue::Number(-0.08))];
    let entry = EffectEntry::new("optical_distortion", parameters.into());
    model.effects.push(entry);
    let report = closed(&model, &bundle).expect("the loop closes").report;
    assert_eq!(report.verdict, Verdict::Consistent, "{:?}", report.effects);
    is_noise(report.before.chi2_per_dof, &report, 20);
}

/// A lens of a wide field may bend as such lenses do, and the model that is written closes the loop.
#[test]
fn a_wide_lens_is_found_and_taken_off() {
    let truth = -0.08;
    let (model, bundle) = taken(7, 20, wide(truth));
    let found = closed(&model, &bundle).expect("the loop closes");
    assert_eq!(named(&found.report), ["optical_distortion"]);
    let k1 = &found.report.effects[0].parameters["k1"];
    let z = (k1.value - truth) / k1.sigma.expect("a sigma");
    assert!(z.abs() < 4.0, "{z} sigma");
    is_noise(found.report.after.chi2_per_dof, &found.report, 20);
    let again = closed(&found.model, &bundle)
        .expect("the loop closes")
        .report;
    assert_eq!(again.verdict, Verdict::Consistent, "{:?}", again.effects);
}

/// Pixels that are not square, and a boresight that is 0.0028 and -0.0017 of the focal length off the middle. The second
/// is a tilt of as much but for the square of it, a scale of 8e-6: of 1800 stars 290 px off the middle each tells that to
/// 0.074/(290 sqrt(1800)) = 6e-6.
#[test]
fn what_is_wrong_with_a_detector_is_told_from_a_lens() {
    let focal_px = 512.0 / 10.0_f64.to_radians().tan();
    let middle_px = [0.0028 * focal_px, -0.0017 * focal_px];
    let narrow = Lens {
        aspect: 0.001,
        ..Lens::default()
    };
    let off = Lens {
        middle_px,
        ..Lens::default()
    };
    for (lens, terms) in [
        (narrow, [("b1", 0.001), ("b2", 0.0)]),
        (off, [("t1", -0.0028), ("t2", 0.0017)]),
    ] {
        let report = pictures(10, 60, lens);
        assert_eq!(named(&report), ["optical_distortion"]);
        let found = &report.effects[0].parameters;
        let names: Vec<&str> = found.keys().map(String::as_str).collect();
        assert_eq!(names, terms.map(|(name, _)| name));
        for (name, truth) in terms {
            let z = (found[name].value - truth) / found[name].sigma.expect("a sigma");
            assert!(z.abs() < 4.0, "{name}: {z} sigma");
        }
        is_noise(report.after.chi2_per_dof, &report, 60);
    }
}

/// What is done to a bundle.
type Spoil<'a> = &'a dyn Fn(&mut Bundle);

/// Pictures that are mirrored, and catalogues in hours and in radians, fit no attitude, and it is said why. A lens is no
/// convention.
#[test]
fn stars_in_another_convention_are_refused() {
    let refused = |spoil: Spoil<'_>, lens: Lens| {
        let (model, mut bundle) = taken(4, 8, lens);
        spoil(&mut bundle);
        closed(&model, &bundle)
            .map(|_| ())
            .map_err(|e| e.to_string())
    };
    let read = |angles: fn([f64; 2]) -> [f64; 2]| {
        move |bundle: &mut Bundle| {
            let catalogue = bundle.catalog.as_ref().expect("it has one");
            let mut stars = catalogue.stars().to_vec();
            for star in &mut stars {
                [star.ra_deg, star.dec_deg] = angles([star.ra_deg, star.dec_deg]);
            }
            bundle.catalog = Some(Catalogue::new(2000.0, stars).expect("a catalogue"));
        }
    };
    let mirrored = |bundle: &mut Bundle| {
        let stars = bundle.stars.as_mut().expect("it has some");
        core::mem::swap(&mut stars.x_px, &mut stars.y_px);
    };
    let hours = read(|[ra, dec]| [ra / 15.0, dec]);
    let radians = read(|angles| angles.map(f64::to_radians));
    let spoils: [(Spoil<'_>, [&str; 2]); 3] = [
        (
            &mirrored,
            ["table stars, columns x_px, y_px", "a mirrored picture"],
        ),
        (&hours, ["table catalog, column ra_deg", "read as hours"]),
        (&radians, ["columns ra_deg, dec_deg", "read as radians"]),
    ];
    for (spoil, said) in spoils {
        let words = refused(spoil, Lens::default()).expect_err("it is refused");
        assert!(said.iter().all(|said| words.contains(said)), "{words}");
    }
    let bent = Lens {
        k0: 0.05,
        ..wide(-0.2)
    };
    assert!(refused(&|_| {}, bent).is_ok());
}

/// A wave of 0.12 px is that of where the light falls, which it does not move: evaluated where it takes the
/// centroid itself, half of its square would stand in the second order, 0.12 pi 0.12/2 = 0.02 px or ten of its sigmas.
#[test]
fn a_wave_in_pixel_phase_does_not_move_the_light() {
    let lens = Lens {
        phase_px: 0.12,
        ..Lens::default()
    };
    let report = pictures(8, 60, lens);
    assert_eq!(named(&report), ["pixel_phase_harmonics"]);
    let found = &report.effects[0].parameters;
    let names: Vec<&str> = found.keys().map(String::as_str).collect();
    let first = [
        "x1_amplitude_arcsec",
        "x1_phase_rad",
        "y1_amplitude_arcsec",
        "y1_phase_rad",
    ];
    assert_eq!(names, first);
    let truth = arcsec(0.12);
    for name in ["x1_amplitude_arcsec", "y1_amplitude_arcsec"] {
        let z = (found[name].value - truth) / found[name].sigma.expect("a sigma");
        assert!(z.abs() < 4.0, "{name}: {z} sigma");
    }
}

/// 30 km/s make the scale of a picture differ by 1e-4 from where the camera flies to to where it comes from: of
/// thirty stars 290 px off the middle each tells it to 0.074/(290 sqrt(60)) = 3.3e-5, sixty of them the
/// velocity along any axis to 3.3e-5 sqrt(3/60) = 7e-6 of c, 14 sigma.
#[test]
fn a_steady_velocity_is_told_by_the_scales() {
    let truth = Vector3::new(12_000.0, -24_000.0, 13_000.0);
    let lens = Lens {
        velocity_m_s: truth,
        ..Lens::default()
    };
    let report = pictures(9, 60, lens);
    assert_eq!(named(&report), ["velocity_aberration"]);
    let speed = &report.effects[0].parameters["speed_m_s"];
    let z = (speed.value - truth.norm()) / speed.sigma.expect("a sigma");
    assert!(z.abs() < 4.0, "{} m/s, {z} sigma", speed.value);
    is_noise(report.after.chi2_per_dof, &report, 60);
}

/// Where noise grows with the magnitude, the model says from which level: read again, it is consistent with the
/// data, whose squares are what it says to within what the weights of a solution by equal weights leave.
#[test]
fn a_slope_of_the_noise_has_its_level() {
    let lens = Lens {
        slope: 1.0,
        ..Lens::default()
    };
    let (mut model, bundle) = taken(10, 40, lens);
    // some level: it is estimated
    model.noise.temporal_arcsec = model.noise.temporal_arcsec.map(|s| 0.6 * s);
    let found = closed(&model, &bundle).expect("the loop closes");
    assert_eq!(named(&found.report), ["magnitude_noise"]);
    let again = closed(&found.model, &bundle)
        .expect("the loop closes")
        .report;
    assert_eq!(again.verdict, Verdict::Consistent, "{:?}", again.effects);
    for chi2 in [found.report.after.chi2_per_dof, again.before.chi2_per_dof] {
        let chi2 = chi2.expect("chi-squared");
        assert!((0.85..1.25).contains(&chi2), "{chi2}");
    }
}

/// Forty pictures of twenty stars at 2 Hz, whose focal length grows by 10 ppm/s: some fifty nats. Of five blocks in time
/// two hold the drift, and its chance is 3e-5 by them; t of ten sigma and of twenty degrees, for as many stars, is 1e-9.
#[test]
fn a_drift_in_few_pictures_is_beyond_doubt() {
    for seed in 3..6 {
        let mut case = Case::new(Path::Still, seed);
        case.duration_s = 20.0;
        case.stars = 20;
        let case = case.with("focal_length_drift", "ppm_per_s = 10.0");
        let (model, mut bundle) = case.make();
        bundle.reference = None;
        let report = closed(&model, &bundle).expect("the loop closes").report;
        assert_eq!(named(&report), ["focal_length_drift"], "seed {seed}");
        // in time or with a temperature, which in twenty seconds is the same
        let p = report.effects[0].p_value;
        assert!(p < 1e-8, "seed {seed}: {p}");
    }
}

/// A scale that was right when the run began, where no distortion is declared: 60 ppm in two minutes, on average 30.
/// With a drift about the middle alone that was a wrong focal length, of more nats than the drift, and the drift.
#[test]
fn a_drift_from_the_start_is_one_effect() {
    for seed in 3..6 {
        let mut case = Case::new(Path::Still, seed);
        case.duration_s = 120.0;
        case.stars = 20;
        let case = case.reference("none");
        let case = case.with("focal_length_drift", "ppm_per_s = 0.5\nfrom_s = 0.0");
        let report = reported(&case.quiet(5.0));
        assert_eq!(named(&report), ["focal_length_drift"], "seed {seed}");
        let drift = &report.effects[0].parameters["ppm_per_s"];
        let z = (drift.value - 0.5) / drift.sigma.expect("a sigma");
        assert!(
            z.abs() < 4.0,
            "seed {seed}: {} ppm/s, {z} sigma",
            drift.value
        );
    }
}
