//! The inertial hold of [M23] Section 4.1, preset `iht` with its motion, rate, length and stars, at both fidelities:
//! rendered pixels, and the physics-based model with sigmas that were measured on the rendered stars. `docs/imager.md` shows what is printed (`-- --nocapture`).
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use boresight::focal_plane::{
    ARCSEC_PER_RAD, AttitudeSeries, AttitudeSource, Camera, Pixel, rotation_vector,
};
use boresight::imager::{BackgroundLevel, Instrument, Run, frames};
use boresight::scenarios::{Course, HipparcosSky, Scenario, Sky, hipparcos, preset, simulate};
use boresight::telemetry::{Bundle, ModelNoise};
use nalgebra::{Matrix3, Vector3};
use spectra::{LogAverage, Psd, Welch, WelchSettings};
use std::collections::{BTreeMap, BTreeSet};

/// The preset's tracker with a small spot in faint light, so that both parts are about as large as those of the
/// paper.
fn instrument(scenario: &Scenario) -> Instrument {
    let mut instrument = Instrument::of_model(&scenario.model).unwrap();
    instrument.stars.followed = 14;
    instrument.stars.limiting_mag = 6.5;
    instrument.optics.psf_sigma_px = 0.28;
    instrument.detector.electrons_s_mag0 = 1.5e6;
    instrument.detector.full_well_e = 4e5;
    instrument.detector.bits = 16;
    instrument.readout.background = BackgroundLevel::Fixed;
    instrument.readout.background_dn = Some(100.0);
    instrument.stars.separation_px = 0.0;
    instrument
}

/// Attitude error, arcsec, axis by axis.
fn attitude_errors(bundle: &Bundle, truth: &AttitudeSeries) -> [Vec<f64>; 3] {
    let attitude = bundle.attitude.as_ref().unwrap();
    let mut axes = [const { Vec::new() }; 3];
    for (t, q) in attitude.t_s.iter().zip(&attitude.q) {
        let error = rotation_vector(q, &truth.attitude(*t).unwrap()) * ARCSEC_PER_RAD;
        for (axis, error) in axes.iter_mut().zip(error.iter()) {
            axis.push(*error);
        }
    }
    axes
}

/// Variances of one star, arcsec^2 of one axis: white, and the rest.
struct StarNoise {
    at: Pixel,
    white: [f64; 2],
    rest: [f64; 2],
}

/// The white part from differences of neighbouring frames, in which drift and jitter, below 0.001 px, change
/// nothing else.
fn star_noise(bundle: &Bundle, truth: &AttitudeSeries, camera: &Camera) -> Vec<StarNoise> {
    let (stars, catalogue) = (
        bundle.stars.as_ref().unwrap(),
        bundle.catalog.as_ref().unwrap(),
    );
    let scale = camera.arcsec_per_px()[0];
    let mut by_star: BTreeMap<i64, (Vec<[f64; 2]>, Pixel)> = BTreeMap::new();
    for k in 0..stars.frames() {
        let q = truth.attitude(stars.t_s[k]).unwrap();
        for row in stars.rows_of(k) {
            let index = catalogue.index_of(stars.star_id[row]).unwrap();
            let at = camera
                .project(&(q * catalogue.direction_at(index, 2000.0)))
                .unwrap();
            let error = [stars.x_px[row] - at.x, stars.y_px[row] - at.y].map(|e| e * scale);
            let (errors, place) = by_star.entry(stars.star_id[row]).or_default();
            errors.push(error);
            *place = at;
        }
    }
    let one = |(errors, at): (Vec<[f64; 2]>, Pixel)| {
        let n = errors.len() as f64;
        let white = [0, 1].map(|axis| {
            let squares = errors.windows(2).map(|w| (w[1][axis] - w[0][axis]).powi(2));
            0.5 * squares.sum::<f64>() / (n - 1.0)
        });
        let all = [0, 1].map(|axis| errors.iter().map(|e| e[axis].powi(2)).sum::<f64>() / n);
        let rest = [all[0] - white[0], all[1] - white[1]];
        StarNoise { at, white, rest }
    };
    by_star.into_values().map(one).collect()
}

/// Mean over stars and axes.
fn mean(stars: &[StarNoise], of: impl Fn(&StarNoise) -> [f64; 2]) -> f64 {
    stars
        .iter()
        .map(|star| of(star).iter().sum::<f64>())
        .sum::<f64>()
        / (2.0 * stars.len() as f64)
}

/// By how much the white variance about each axis is above that of stars that are all alike: all weigh the
/// same, `P = N^-1 (sum J^T R J) N^-1`, `N = sum J^T J`.
fn unlike_stars(stars: &[StarNoise], camera: &Camera) -> [f64; 3] {
    let (mut normal, mut noise) = (Matrix3::zeros(), Matrix3::zeros());
    for star in stars {
        for (row, variance) in camera.rotation_jacobian(star.at).iter().zip(star.white) {
            let row = Vector3::from(*row);
            normal += row * row.transpose();
            noise += row * row.transpose() * variance;
        }
    }
    let inverse = normal.try_inverse().unwrap();
    let unlike = inverse * noise * inverse;
    let alike = inverse * mean(stars, |star| star.white);
    [0, 1, 2].map(|axis| unlike[(axis, axis)] / alike[(axis, axis)])
}

/// Frames per second, as in the preset.
const RATE_HZ: f64 = 10.0;

fn spectrum(x: &[f64]) -> Psd {
    Welch::new(WelchSettings::half_overlap(20_480, RATE_HZ))
        .unwrap()
        .process(x)
        .unwrap()
}

/// What agrees, because the model holds it: the white level, and the power at the pixel's own period. What
/// does not, because it idealises: a triangle has odd harmonics, a spot of 0.28 px has none to speak of;
/// and one sigma for stars of all magnitudes, which geometry weighs differently about the boresight.
#[test]
fn both_fidelities_agree_where_the_model_holds() {
    let mut scenario = preset("iht").unwrap().scenario().unwrap();
    let course = Course::from(&scenario);
    let (truth, t_s) = course.truth(RATE_HZ).unwrap();
    let run = Run {
        frames: t_s.len() as u64,
        rate_hz: RATE_HZ,
        seed: course.run.seed,
        ..Run::default()
    };
    let pixel = frames(
        &instrument(&scenario),
        &truth,
        &hipparcos(2000.0).unwrap(),
        &run,
    )
    .unwrap();
    let camera = pixel.camera.clone().unwrap();
    let stars = star_noise(&pixel, &truth, &camera);
    let (white, rest) = (
        mean(&stars, |star| star.white),
        mean(&stars, |star| star.rest),
    );
    let geometry = unlike_stars(&stars, &camera);
    // circular; and the peak of a triangle of this variance
    let (temporal, peak) = ((2.0 * white).sqrt(), (3.0 * rest).sqrt());
    println!(
        "measured on stars: temporal {temporal:.2} arcsec circular, triangle {peak:.2} arcsec peak"
    );
    // what the rendered optics do not have, the model has not either
    scenario.model.noise = ModelNoise {
        temporal_arcsec: Some(temporal),
        centroid_arcsec: Some(peak),
        ..ModelNoise::default()
    };
    scenario.sky = Sky::Hipparcos(HipparcosSky {
        stars: Some(14),
        limiting_mag: 6.5,
        margin_px: 8.0,
    });
    let formula = simulate(&scenario).unwrap();
    let ids = |bundle: &Bundle| -> BTreeSet<i64> {
        let stars = bundle.catalog.as_ref().unwrap().stars().iter();
        stars.map(|star| star.id).collect()
    };
    println!("{} frames, {} stars", t_s.len(), ids(&pixel).len());
    assert_eq!(ids(&pixel), ids(&formula), "the same stars");
    let [ours, theirs] = [&pixel, &formula]
        .map(|bundle| attitude_errors(bundle, &truth).map(|errors| spectrum(&errors)));
    for (axis, name) in ["X", "Y", "Z"].iter().enumerate() {
        let (a, b) = (&ours[axis], &theirs[axis]);
        let plan = LogAverage::new(a, 3.0).unwrap();
        let means = |psd: &Psd| plan.apply(psd, &[1.0]);
        let (ma, mb) = (means(a), means(b));
        let bands: Vec<String> = (0..ma.len())
            .map(|k| format!("{:.4} Hz {:.2}", ma.frequency_hz[k], ma.psd[k] / mb.psd[k]))
            .collect();
        println!("{name}: pixel/model {}", bands.join(", "));
    }
    let ratio = |axis: usize, low: f64, high: f64| {
        ours[axis].band_variance(low, high).unwrap()
            / theirs[axis].band_variance(low, high).unwrap()
    };
    for axis in 0..3 {
        let white = ratio(axis, 0.2, 4.5);
        let (period, harmonics) = (ratio(axis, 0.0009, 0.0030), ratio(axis, 0.0045, 0.0085));
        let by_geometry = geometry[axis];
        println!(
            "axis {axis}: white {white:.3} (unlike stars: {by_geometry:.3}), pixel's period {period:.3}, harmonics {harmonics:.3}"
        );
        // 2 x 4.3 Hz x 14 400 s numbers on either side: 5 sqrt(2 x 2/123 840) = 0.03 of each other; and a star that
        // is there for a part of the run counts as a whole one in the means
        assert!(
            (white / by_geometry - 1.0).abs() < 0.1,
            "axis {axis}: {white} {by_geometry}"
        );
        // a triangle has 96/pi^4 = 0.986 of its variance at the period, a sinus all: 1.015. The phases of
        // the stars are the same on both sides; white noise is a tenth of the power there and scatters
        // by half over its few averages
        assert!((period - 1.0).abs() < 0.15, "axis {axis}: {period}");
        // the triangle's third harmonic is not there
        assert!(harmonics < 0.8, "axis {axis}: {harmonics}");
    }
}
