//! Unrelated pictures of the sky: stars and a catalogue, nothing else.

use focal_plane::{Camera, Catalogue, CatalogueStar, Pixel, StarFrames, Tangent, aberrated};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use telemetry::report::{Report, Verdict};
use telemetry::{Bundle, Model};

use crate::kit::{Case, Path, closed, named};

/// Noise of a centroid on each axis, px; the model declares it.
const NOISE_PX: f64 = 0.074;

/// A camera that is not quite what was declared.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lens {
    pub(crate) k0: f64,
    pub(crate) k1: f64,
    pub(crate) k2: f64,
    pub(crate) k3: f64,
    /// Pixels are narrower than they are high by this share.
    pub(crate) aspect: f64,
    /// Where the boresight falls beside the middle of the detector, px.
    pub(crate) middle_px: [f64; 2],
    /// Centroids are off by so much times the sine of the pixel phase, px.
    pub(crate) phase_px: f64,
    /// One star in this many is another one, some pixels off, and how many.
    pub(crate) mistaken: Option<u64>,
    pub(crate) off_px: f64,
    /// Field, deg, and stars in the sky: some thirty in a picture.
    pub(crate) fov_deg: f64,
    pub(crate) stars: i64,
    /// Velocity of the camera, m/s.
    pub(crate) velocity_m_s: Vector3<f64>,
    /// Noise grows by 10^(0.2 slope (m - 5)).
    pub(crate) slope: f64,
}

impl Default for Lens {
    fn default() -> Self {
        Self {
            k0: 0.0,
            k1: 0.0,
            k2: 0.0,
            k3: 0.0,
            aspect: 0.0,
            middle_px: [0.0; 2],
            phase_px: 0.0,
            mistaken: None,
            off_px: 60.0,
            fov_deg: 20.0,
            stars: 3000,
            velocity_m_s: Vector3::zeros(),
            slope: 0.0,
        }
    }
}

/// So many pixels of the camera of 20 deg, arcsec.
pub(crate) fn arcsec(px: f64) -> f64 {
    px * 10.0_f64.to_radians().tan() / 512.0 * 206_264.8
}

/// Closes the loop on `frames` pictures of about thirty stars each.
pub(crate) fn pictures(seed: u64, frames: usize, lens: Lens) -> Report {
    let (model, bundle) = taken(seed, frames, lens);
    closed(&model, &bundle).expect("the loop closes").report
}

/// `frames` pictures of about thirty stars each, and a model that declares their noise alone.
pub(crate) fn taken(seed: u64, frames: usize, lens: Lens) -> (Model, Bundle) {
    let (mut model, mut bundle) = Case::new(Path::Drift, 1).make();
    let camera = Camera::from_fov_deg([1024, 1024], [lens.fov_deg; 2]).expect("a camera");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let sky: Vec<CatalogueStar> = (0..lens.stars)
        .map(|id| {
            let v = Vector3::new(normal(), normal(), normal()).normalize();
            CatalogueStar {
                id,
                ra_deg: v.y.atan2(v.x).to_degrees().rem_euclid(360.0),
                dec_deg: v.z.asin().to_degrees(),
                mag: 4.0 + normal(),
                ..CatalogueStar::default()
            }
        })
        .collect();
    let mut other = Xoshiro256PlusPlus::seed_from_u64(1000 + seed);
    let mut stars = StarFrames::new();
    for k in 0..frames {
        stars.t_s.push(k as f64);
        let q = UnitQuaternion::from_quaternion(Quaternion::new(
            normal(),
            normal(),
            normal(),
            normal(),
        ));
        for star in &sky {
            let (ra, dec) = (star.ra_deg.to_radians(), star.dec_deg.to_radians());
            let u = Vector3::new(dec.cos() * ra.cos(), dec.cos() * ra.sin(), dec.sin());
            let v = q * aberrated(&u, &lens.velocity_m_s);
            let Some(ideal) = camera.project(&v).filter(|p| camera.contains(*p)) else {
                continue;
            };
            let Tangent { x, y } = camera.tangent(ideal);
            let r2 = x * x + y * y;
            let radial = r2 * (lens.k1 + r2 * (lens.k2 + r2 * lens.k3));
            let growth = (1.0 + lens.k0) * (1.0 + radial);
            let on_curve = |p: f64| p + lens.phase_px * camera.phase_rad(p).sin();
            let noise_px = NOISE_PX * 10_f64.powf(0.2 * lens.slope * (star.mag - 5.0));
            let mut at = Pixel {
                x: on_curve(ideal.x * growth * (1.0 + lens.aspect) + lens.middle_px[0])
                    + noise_px * normal(),
                y: on_curve(ideal.y * growth + lens.middle_px[1]) + noise_px * normal(),
            };
            if lens.mistaken.is_some_and(|n| other.next_u64() % n == 0) {
                at.x += lens.off_px * normal();
                at.y += lens.off_px * normal();
            }
            if camera.contains(at) {
                stars.slot.push(0);
                stars.star_id.push(star.id);
                stars.x_px.push(at.x);
                stars.y_px.push(at.y);
            }
        }
        let rows = stars.x_px.len();
        stars.first_row.push(rows);
    }
    // a slot each within its frame
    for frame in 0..frames {
        for (slot, row) in (0..).zip(stars.first_row[frame]..stars.first_row[frame + 1]) {
            stars.slot[row] = slot;
        }
    }
    bundle.stars = Some(stars);
    bundle.catalog = Some(Catalogue::new(2000.0, sky).expect("a catalogue"));
    bundle.attitude = None;
    bundle.reference = None;
    bundle.housekeeping = None;
    let scale = camera.arcsec_per_px()[0];
    model.noise.temporal_arcsec = Some(NOISE_PX * std::f64::consts::SQRT_2 * scale);
    model.noise.centroid_arcsec = Some(0.0);
    model.noise.distortion_arcsec = Some(0.5);
    bundle.camera = Some(camera);
    model.tracker.focal_length_px = None;
    model.tracker.fov_deg = Some([lens.fov_deg; 2]);
    (model, bundle)
}

/// At a design rate of 1 %, 3 of 30 or more come once in 300 such tests.
#[test]
fn nothing_is_found_in_good_pictures() {
    let alarms = (0..30)
        .zip((5..25).cycle())
        .filter(|&(seed, frames)| {
            let report = pictures(seed, frames, Lens::default());
            !report.effects.is_empty() || report.unattributed.present
        })
        .count();
    assert!(alarms <= 2, "{alarms} of 30");
}

/// A dozen pictures of thirty stars fix k0 to 0.074 px / 290 px rms / sqrt(720) = 1e-5; k1
/// takes as much again and more from it. What is left is the noise: 5/sqrt(2 * 720) of it.
#[test]
fn a_wrong_focal_length_and_a_bent_field_are_told_apart() {
    let lens = Lens {
        k0: 0.002,
        k1: 0.05,
        ..Lens::default()
    };
    let report = pictures(7, 12, lens);
    assert_eq!(report.verdict, Verdict::Explained);
    assert_eq!(report.effects.len(), 1, "{:?}", report.effects);
    assert_eq!(report.effects[0].id, "optical_distortion");
    for (name, truth) in [("k0", lens.k0), ("k1", lens.k1)] {
        let found = &report.effects[0].parameters[name];
        let z = (found.value - truth) / found.sigma.expect("a sigma");
        assert!(z.abs() < 5.0, "{name}: {} sigma", z);
    }
    let chi2 = report.after.chi2_per_dof.expect("chi-squared");
    assert!((chi2 - 1.0).abs() < 5.0 / 720_f64.sqrt(), "{chi2}");
}

/// The lens moves stars by up to 16 px, and the pixel phase is that of where they then fall: an amplitude is
/// known to 0.074 px sqrt(2 / 1800 rows) = 0.0025 px, 20 sigma. The bending is that of where the light starts;
/// taken from where the first fit without a lens has it, it needs terms of higher order too.
#[test]
fn pixel_phase_is_that_of_where_a_lens_takes_the_light() {
    let lens = Lens {
        k1: 1.0,
        phase_px: 0.05,
        ..Lens::default()
    };
    let report = pictures(3, 60, lens);
    assert_eq!(report.verdict, Verdict::Explained);
    let ids = named(&report);
    assert_eq!(ids, ["optical_distortion", "pixel_phase_harmonics"]);
    let lens_terms: Vec<&String> = report.effects[0].parameters.keys().collect();
    assert_eq!(lens_terms, ["k1"]);
    let arcsec = arcsec(0.05);
    for (effect, name, truth) in [
        (0, "k1", lens.k1),
        (1, "x1_amplitude_arcsec", arcsec),
        (1, "y1_amplitude_arcsec", arcsec),
    ] {
        let found = &report.effects[effect].parameters[name];
        let z = (found.value - truth) / found.sigma.expect("a sigma");
        assert!(z.abs() < 4.0, "{name}: {} sigma", z);
    }
}

/// One star in a hundred is another, tens of pixels off, under a lens that bends by as much: those rows
/// go, and only those. Each pulls the thirty stars of its frame two pixels along, thirty sigma: under a
/// good lens a quarter of the rows would go, were all that stand out marked at once. Of the mistaken, 0.01 % lie within 8
/// sigma on both axes (0.6 of 60 px).
#[test]
fn mistaken_stars_neither_hide_nor_pull_their_frames_along() {
    let lens = Lens {
        k0: 0.002,
        k1: 0.05,
        mistaken: Some(100),
        ..Lens::default()
    };
    let report = pictures(11, 20, lens);
    let ids = named(&report);
    assert_eq!(ids, ["optical_distortion"]);
    let good = Lens {
        mistaken: lens.mistaken,
        ..Lens::default()
    };
    for rows in [&report.rows, &pictures(11, 20, good).rows] {
        let all = (rows.used + rows.outliers) as f64;
        let share = rows.outliers as f64 / all;
        // binomial, five sigma
        assert!(
            (share - 0.01).abs() < 5.0 * (0.01 * 0.99 / all).sqrt(),
            "{share} of {all}"
        );
    }
    let rows = report.rows.used as f64;
    let chi2 = report.after.chi2_per_dof.expect("chi-squared");
    assert!(
        (chi2 - 1.0).abs() < 5.0 / (0.5 * 2.0 * rows).sqrt(),
        "{chi2}"
    );
}

/// Two pictures are enough to be predicted from each other.
#[test]
fn two_pictures_are_enough() {
    let lens = Lens {
        k1: 0.05,
        ..Lens::default()
    };
    let report = pictures(3, 2, lens);
    assert_eq!(report.effects.len(), 1, "{:?}", report.effects);
    assert_eq!(report.effects[0].id, "optical_distortion");
}

/// A lens of a wide field before pixels that are a tenth higher than they are wide and a detector that is off its
/// axis by 6 px: bent by 0.38 r^2 and more, then stretched, so that what one does to the other is 4 px at the edge,
/// 50 times the noise. Of a picture of some fifty stars ten lens terms take nothing that shows: chi-squared as above.
#[test]
fn a_lens_before_pixels_that_are_not_square_leaves_the_noise() {
    let lens = Lens {
        k0: 0.02,
        k1: -0.38,
        k2: 0.22,
        k3: -0.08,
        aspect: -0.09,
        middle_px: [-6.0, 2.0],
        fov_deg: 65.0,
        stars: 600,
        ..Lens::default()
    };
    let report = pictures(5, 9, lens);
    assert_eq!(named(&report), ["optical_distortion"]);
    assert_eq!(report.verdict, Verdict::Explained);
    let found = &report.effects[0].parameters;
    for (name, truth) in [("k1", lens.k1), ("k2", lens.k2), ("k3", lens.k3)] {
        let z = (found[name].value - truth) / found[name].sigma.expect("a sigma");
        assert!(z.abs() < 4.0, "{name}: {z} sigma");
    }
    let rows = report.rows.used as f64;
    let chi2 = report.after.chi2_per_dof.expect("chi-squared");
    assert!((chi2 - 1.0).abs() < 5.0 / rows.sqrt(), "{chi2} of {rows}");
}
