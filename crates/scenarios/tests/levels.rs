//! Levels of a simulated bundle against theory: every declared error has the size that the model
//! states, per axis and star, with the conversions of errata E2 and E15.

mod common;

use common::{SLEWS, scenario};
use distortion::DistortionField;
use focal_plane::{AttitudeSource, Pixel};
use nalgebra::Vector3;
use scenarios::{Simulated, simulate_with_truth};

/// Ideal position of each row with its time, px: projection of the true direction at the true attitude.
fn ideal(simulated: &Simulated) -> Vec<(f64, Pixel)> {
    let [x, y, z] = &simulated.direction;
    let t_s = simulated.rows.t_of_rows_s();
    let at = |row: usize| {
        let q = simulated.truth.attitude(t_s[row])?;
        simulated
            .pbm
            .camera()
            .project(&(q * Vector3::new(x[row], y[row], z[row])))
    };
    (0..t_s.len())
        .filter_map(|row| Some((t_s[row], at(row)?)))
        .collect()
}

fn mean_square(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (mut sum, mut n) = (0.0, 0.0);
    for value in values {
        sum += value * value;
        n += 1.0;
    }
    (sum / n, n)
}

/// Temporal noise: 7.43 arcsec circular is 7.43/sqrt 2 per axis. The variance of n normal samples has
/// relative error sqrt(2/n).
#[test]
fn temporal_noise_is_its_circular_sigma_over_root_two() {
    let run = "[run]\nduration_s = 140.0\nrate_hz = 10.0\nseed = 3";
    let given = scenario("temporal_arcsec = 7.43", &format!("{SLEWS}{run}")).unwrap();
    let simulated = simulate_with_truth(&given, 0).unwrap();
    let m = &simulated.measured;
    let scale = simulated.pbm.camera().arcsec_per_px();
    for (axis, (noisy, clean)) in [(&m.x_px, &m.noise_free_x_px), (&m.y_px, &m.noise_free_y_px)]
        .into_iter()
        .enumerate()
    {
        let (got, n) = mean_square(noisy.iter().zip(clean).map(|(a, b)| (a - b) * scale[axis]));
        let expected = 7.43_f64.powi(2) / 2.0;
        assert!(n > 15_000.0);
        assert!(
            (got / expected - 1.0).abs() < 5.0 * (2.0 / n).sqrt(),
            "axis {axis}: {got} {expected}"
        );
    }
}

/// Triangle: a peak of 5.06 arcsec has mean square peak^2/3 over a uniform phase (erratum E2). Phases
/// of a star that crosses c pixels in n samples are equidistributed to about 1/c; 14 stars and
/// hundreds of pixels leave the sampling error of n independent phases as the larger one:
/// var(c^2) = peak^4 (1/5 - 1/9).
#[test]
fn the_triangle_is_its_peak_over_root_three() {
    let run = "[run]\nduration_s = 140.0\nrate_hz = 10.0\nseed = 3";
    let given = scenario("centroid_arcsec = 5.06", &format!("{SLEWS}{run}")).unwrap();
    let simulated = simulate_with_truth(&given, 0).unwrap();
    let ideal = ideal(&simulated);
    let m = &simulated.measured;
    assert_eq!(ideal.len(), m.x_px.len());
    let [sx, sy] = simulated.pbm.camera().arcsec_per_px();
    let x = m
        .noise_free_x_px
        .iter()
        .zip(&ideal)
        .map(|(a, (_, at))| (a - at.x) * sx);
    let y = m
        .noise_free_y_px
        .iter()
        .zip(&ideal)
        .map(|(a, (_, at))| (a - at.y) * sy);
    for (name, (got, n)) in [("x", mean_square(x)), ("y", mean_square(y))] {
        let expected = 5.06_f64.powi(2) / 3.0;
        let tolerance = 5.0 * (0.2_f64 - 1.0 / 9.0).sqrt() * 3.0 / n.sqrt();
        assert!(
            (got / expected - 1.0).abs() < tolerance,
            "{name}: {got} against {expected}"
        );
    }
}

/// Distortion: 3.1667 arcsec circular is 3.1667/sqrt 2 per axis over the field, exactly by construction
/// of each draw; the rows hold just that field; and over 300 draws of stars spread evenly the mean
/// square is the same, to 5 times the standard error found among the draws.
#[test]
fn distortion_is_its_circular_sigma_over_root_two() {
    let rest = "[motion]\nkind = \"hold\"\n[sky]\nkind = \"generated\"\n[run]\nduration_s = 1.0\nrate_hz = 1.0";
    let given = scenario("distortion_arcsec = 3.1667", rest).unwrap();
    let expected = 3.1667_f64.powi(2) / 2.0;
    let mut squares = Vec::new();
    for draw in 0..300 {
        let simulated = simulate_with_truth(&given, draw).unwrap();
        let field: &DistortionField = simulated.pbm.distortion();
        for deviation in field.deviation_arcsec() {
            // rounding of 64 coefficients
            assert!((deviation * deviation / expected - 1.0).abs() < 1e-10);
        }
        let camera = simulated.pbm.camera();
        let scale = camera.arcsec_per_px();
        let mut sum = 0.0;
        let ideal = ideal(&simulated);
        for (row, (_, at)) in ideal.iter().enumerate() {
            let shift = [
                (simulated.measured.x_px[row] - at.x) * scale[0],
                (simulated.measured.y_px[row] - at.y) * scale[1],
            ];
            let field = field.evaluate(camera.normalised(*at));
            for axis in 0..2 {
                // rounding of positions up to 512 px: 1e-13 px
                assert!((shift[axis] - field[axis]).abs() < 1e-9);
                sum += shift[axis] * shift[axis];
            }
        }
        squares.push(sum / (2.0 * ideal.len() as f64));
    }
    let n = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / n;
    let spread = squares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0);
    assert!(
        (mean - expected).abs() < 5.0 * (spread / n).sqrt(),
        "{mean} against {expected}"
    );
    assert!(
        (spread / n).sqrt() < 0.1 * expected,
        "the test could see an error of half"
    );
}

/// The constant misalignment of a draw has the model's sigma: 200 draws of three axes, relative error
/// of the variance sqrt(2/600). Without noise QUEST returns it exactly.
#[test]
fn the_bias_is_drawn_with_its_sigma() {
    let rest = "[motion]\nkind = \"hold\"\n[sky]\nkind = \"generated\"\n[run]\nduration_s = 1.0\nrate_hz = 1.0";
    let given = scenario("bias_arcsec = [8.0, 4.0, 2.0]", rest).unwrap();
    let mut sum = 0.0;
    for draw in 0..200 {
        let simulated = simulate_with_truth(&given, draw).unwrap();
        let q = simulated.measured.attitude(0).unwrap();
        let theta = focal_plane::rotation_vector(&q, &simulated.truth.attitude(0.0).unwrap());
        for (theta, sigma) in theta.iter().zip([8.0, 4.0, 2.0]) {
            sum += (theta * focal_plane::ARCSEC_PER_RAD / sigma).powi(2);
        }
    }
    assert!(
        (sum / 600.0 - 1.0).abs() < 5.0 * (2.0_f64 / 600.0).sqrt(),
        "{}",
        sum / 600.0
    );
}
