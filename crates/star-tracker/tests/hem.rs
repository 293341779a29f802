//! The hybrid model against theory: its spectrum, its distortion path, and its streams.

use std::error::Error;

use distortion::{DistortionField, LsfSigma};
use focal_plane::{
    ARCSEC_PER_RAD, Angle, AttitudeSeries, AttitudeSource, Camera, UniformRotation, Vectors,
    rotation_vector,
};
use fogm_fit::{Fogm, FogmWhite, sampled};
use nalgebra::{UnitQuaternion, Vector3};
use spectra::{Welch, WelchSettings};
use star_tracker::{
    Hem, HemState, Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, StarField, k0,
    k0_as_printed, stream,
};

type Outcome = Result<(), Box<dyn Error>>;

fn camera() -> Result<Camera, Box<dyn Error>> {
    Ok(Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?)
}

fn axes() -> Result<[FogmWhite; 3], Box<dyn Error>> {
    Ok([
        FogmWhite::new(Fogm::new(0.8, 20.0)?, 1.4)?,
        FogmWhite::new(Fogm::new(3.0, 5.0)?, 0.5)?,
        FogmWhite::new(Fogm::new(5.0, 60.0)?, 9.0)?,
    ])
}

/// Frames without rows: all that a model without distortion asks for.
fn no_stars<'a>(t_s: &'a [f64], first_row: &'a [usize]) -> Rows<'a> {
    Rows {
        t_s,
        first_row,
        slot: &[],
        star_id: &[],
        mag: &[],
        bv: &[],
        direction: Vectors {
            x: &[],
            y: &[],
            z: &[],
        },
    }
}

/// Error of each frame against the truth, arcsec.
fn errors(measured: &Measured, truth: &dyn AttitudeSource, t_s: &[f64]) -> Vec<Vector3<f64>> {
    let error = |(k, &t): (usize, &f64)| {
        let q = measured.attitude(k).expect("solved");
        rotation_vector(&q, &truth.attitude(t).expect("in span")) * ARCSEC_PER_RAD
    };
    t_s.iter().enumerate().map(error).collect()
}

fn run(hem: &Hem, truth: &dyn AttitudeSource, t_s: &[f64], state: &mut HemState) -> Measured {
    let first_row = vec![0; t_s.len() + 1];
    let mut out = Measured::default();
    let mut streams = NoiseStreams::new(1, 0);
    hem.measure_into(
        truth,
        no_stars(t_s, &first_row),
        state,
        &mut streams,
        &mut Scratch::default(),
        &mut out,
    );
    out
}

/// The spectrum of each axis is the sampled density of its parameters (erratum E8), band by band, while
/// the tracker turns: the error is in tracker axes.
///
/// The mean of m bins of nu degrees of freedom, neighbours sharing 35/18, has relative deviation
/// `sqrt(2 / nu  35/18 / m)`; a Hann segment of 4096 samples (410 s) leaks by the curvature of the
/// density, below 1 % where the band is above 4/410 s.
#[test]
fn each_axis_has_the_density_of_its_parameters() -> Outcome {
    let truth = UniformRotation {
        rate_rad_s: Vector3::new(1e-3, -2e-3, 4e-4),
        ..Default::default()
    };
    let t_s: Vec<f64> = (0..400_000).map(|k| 0.1 * f64::from(k)).collect();
    let hem = Hem::new(camera()?, axes()?);
    let measured = run(&hem, &truth, &t_s, &mut HemState::new(3, 0));
    assert!(measured.x_px.is_empty());
    let error = errors(&measured, &truth, &t_s);
    let welch = Welch::new(WelchSettings::half_overlap(4096, 10.0))?;
    for axis in 0..3 {
        let series: Vec<f64> = error.iter().map(|e| e[axis]).collect();
        let psd = welch.process(&series)?;
        for [low, high] in [[0.01, 0.02], [0.02, 0.1], [0.1, 1.0], [1.0, 4.9]] {
            let bins = (0..psd.len()).filter(|&k| (low..high).contains(&psd.frequency_hz[k]));
            let (mut sum, mut m) = (0.0, 0.0);
            for k in bins {
                sum += psd.psd[k] / sampled(hem.axes()[axis], psd.frequency_hz[k], 10.0);
                m += 1.0;
            }
            let tolerance = 0.01 + 5.0 * (2.0 / psd.dof[100] * 35.0 / 18.0 / m).sqrt();
            let ratio = sum / m;
            assert!(
                (ratio - 1.0).abs() < tolerance,
                "axis {axis}, {low} Hz: {ratio} +- {tolerance}"
            );
        }
    }
    Ok(())
}

/// K0 makes the block `K0 / (1 - exp(-T/tau) z^-1)`, driven by unit white noise of density `2 T`, have
/// the density of the FOGM term: sampled for `k0`; for `k0_as_printed` Eq. 17 as printed, at low
/// frequency, where sampling does not matter: (T/tau)^2/12 and f = 0.
#[test]
fn k0_scales_white_noise_to_the_density() -> Outcome {
    let (fogm, dt_s) = (Fogm::new(5.06, 161.0)?, 0.1);
    let block = |gain: f64, f: f64| {
        let (a, phase) = (fogm.decay(dt_s), core::f64::consts::TAU * f * dt_s);
        2.0 * dt_s * gain * gain / (1.0 - 2.0 * a * phase.cos() + a * a)
    };
    let process = FogmWhite::new(fogm, 0.0)?;
    for f in [0.0, 1e-3, 0.036, 1.0, 5.0] {
        let ratio = block(k0(fogm, dt_s), f) / sampled(process, f, 10.0);
        assert!((ratio - 1.0).abs() < 1e-9, "{ratio} at {f} Hz");
    }
    let printed = fogm_fit::as_printed(process, 0.0, 10.0);
    let ratio = block(k0_as_printed(fogm, dt_s), 0.0) / printed;
    assert!((ratio - 1.0).abs() < 1e-6, "{ratio}");
    Ok(())
}

/// A series cut into batches is the same series, to the last bit; a seed and a draw are another one;
/// a gap is bridged by the decay over its length: over `g` seconds the correlation of the process is
/// exp(-g/tau), standard error 1/sqrt n over n draws.
#[test]
fn batches_and_gaps_do_not_change_the_process() -> Outcome {
    let truth = UniformRotation::default();
    let t_s: Vec<f64> = (0..300).map(|k| 0.1 * f64::from(k)).collect();
    let hem = Hem::new(camera()?, axes()?);
    let whole = run(&hem, &truth, &t_s, &mut HemState::new(7, 2));
    let mut state = HemState::new(7, 2);
    let mut parts = run(&hem, &truth, &t_s[..111], &mut state);
    let second = run(&hem, &truth, &t_s[111..], &mut state);
    parts.qx.extend(second.qx);
    assert_eq!(whole.qx, parts.qx);
    let other = run(&hem, &truth, &t_s, &mut HemState::new(7, 3));
    assert_ne!(whole.qx, other.qx);

    let slow = FogmWhite::new(Fogm::new(1.0, 20.0)?, 0.0)?;
    let hem = Hem::new(camera()?, [slow; 3]);
    let (mut product, mut n) = (0.0, 0.0);
    for draw in 0..4000 {
        let times = [0.0, 0.1, 10.1];
        let error = errors(
            &run(&hem, &truth, &times, &mut HemState::new(7, draw)),
            &truth,
            &times,
        );
        product += error[1].dot(&error[2]);
        n += 3.0;
    }
    let correlation: f64 = product / n;
    assert!(
        (correlation - f64::exp(-0.5)).abs() < 5.0 / f64::sqrt(n),
        "{correlation}"
    );
    Ok(())
}

/// With distortion the frames are those of a PBM that has the same distortion and nothing else, turned
/// by the errors; the errors are the same as without distortion.
#[test]
fn distortion_enters_through_the_stars() -> Outcome {
    let camera = camera()?;
    let mut rng = stream(5, 0, Purpose::Distortion);
    let field = DistortionField::draw(7, LsfSigma::Circular(Angle::from_arcsec(3.1667)), &mut rng)?;
    let sky = StarField::generate(
        &camera,
        &UnitQuaternion::identity(),
        14,
        &mut stream(5, 0, Purpose::StarField),
    )?;
    let t_s: Vec<f64> = (0..40).map(f64::from).collect();
    let first_row: Vec<usize> = (0..=40).map(|k| 14 * k).collect();
    let column = |axis: usize| -> Vec<f64> {
        let one = || sky.stars().iter().map(|star| star.direction[axis]);
        (0..40).flat_map(|_| one()).collect()
    };
    let (x, y, z) = (column(0), column(1), column(2));
    let rows = Rows {
        direction: Vectors {
            x: &x,
            y: &y,
            z: &z,
        },
        ..no_stars(&t_s, &first_row)
    };
    let truth = UniformRotation {
        rate_rad_s: Vector3::new(1e-4, 0.0, 0.0),
        ..Default::default()
    };
    let (mut scratch, mut bent, mut got) =
        (Scratch::default(), Measured::default(), Measured::default());
    Pbm::new(camera.clone())
        .with_distortion(field.clone())
        .measure_into(
            &truth,
            rows,
            &mut NoiseStreams::new(1, 0),
            &mut scratch,
            &mut bent,
        );
    let plain = Hem::new(camera, axes()?);
    assert!(!plain.needs_stars());
    let hem = plain.clone().with_distortion(field);
    assert!(hem.needs_stars());
    hem.measure_into(
        &truth,
        rows,
        &mut HemState::new(9, 0),
        &mut NoiseStreams::new(1, 0),
        &mut scratch,
        &mut got,
    );
    assert!(got.x_px.is_empty());
    let alone = errors(
        &run(&plain, &truth, &t_s, &mut HemState::new(9, 0)),
        &truth,
        &t_s,
    );
    for (k, alone) in alone.iter().enumerate() {
        let (got, bent) = (got.attitude(k).expect("14"), bent.attitude(k).expect("14"));
        let error = rotation_vector(&got, &bent) * ARCSEC_PER_RAD;
        // rounding of quaternions: 1e-15 rad is 2e-10 arcsec
        assert!((error - alone).norm() < 1e-8);
        let lsfe = rotation_vector(&bent, &truth.attitude(t_s[k]).expect("in span"));
        assert!(lsfe.norm() * ARCSEC_PER_RAD > 0.1, "distortion is seen");
    }
    Ok(())
}

/// Outside the truth there is no attitude, and the processes go on.
#[test]
fn frames_outside_the_truth_have_no_attitude() -> Outcome {
    let still = vec![UnitQuaternion::identity(); 2];
    let truth = AttitudeSeries::new(vec![0.0, 1.0], still, None)?;
    let hem = Hem::new(camera()?, axes()?);
    let measured = run(&hem, &truth, &[0.0, 0.5, 1.5], &mut HemState::new(1, 0));
    assert!(measured.attitude(1).is_some() && measured.attitude(2).is_none());
    assert!(measured.qx[2].is_nan());
    Ok(())
}
