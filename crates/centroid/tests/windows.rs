//! Centroids of windows: formal errors against Monte Carlo, biases, masks, and what is refused.

use std::f64::consts::PI;

use centroid::{
    CentroidEstimate, CentroidFailure, EstimatesMut, FirstMoment, GaussianPsf, GaussianWeighted,
    Noise, Window, WindowBatch, pixel_gaussian_into,
};
use focal_plane::Pixel;
use proptest::prelude::*;
use rand_distr::{Distribution, Poisson, StandardNormal};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

type Boxed = Box<dyn std::error::Error>;

const GAIN_E: f64 = 4.0;
const READ_E: f64 = 12.0;
const BACKGROUND: f64 = 30.0;
const NOISE: Noise<'_> = Noise::Detector {
    gain_e: GAIN_E,
    read_noise_e: READ_E,
    pedestal: 0.0,
};
const FIRST: Pixel = Pixel { x: 100.5, y: -7.5 };

fn window(values: &[f64], columns: usize) -> Window<'_> {
    Window {
        values,
        columns,
        x0_px: FIRST.x,
        y0_px: FIRST.y,
        background: 0.0,
        background_sigma: 0.0,
        unread: None,
    }
}

fn spot(columns: usize, at: Pixel, sigma: f64, flux: f64) -> Result<Vec<f64>, CentroidFailure> {
    let mut values = vec![0.0; columns * columns];
    pixel_gaussian_into(FIRST, columns, at, sigma, flux, &mut values)?;
    Ok(values)
}

/// Runs an estimator over noisy windows: z-scores' mean squares of x, y and flux, and the mean
/// error of x. The background level is wrong by its own sigma each time.
fn monte_carlo(
    estimate: impl Fn(&Window<'_>, &Noise<'_>) -> Result<CentroidEstimate, CentroidFailure>,
    unread: Option<&[bool]>,
    seed: u64,
) -> Result<[f64; 3], Boxed> {
    let (columns, runs, background_sigma) = (7, 4000_u32, 0.8);
    let at = Pixel {
        x: FIRST.x + 3.2,
        y: FIRST.y + 2.9,
    };
    let clean = spot(columns, at, 0.9, 6000.0)?;
    let with_background: Vec<f64> = clean.iter().map(|v| v + BACKGROUND).collect();
    let mut reference = window(&with_background, columns);
    reference.background = BACKGROUND;
    reference.unread = unread;
    let truth = estimate(&reference, &NOISE)?;

    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut squares = [0.0; 3];
    for _ in 0..runs {
        let mut values = Vec::with_capacity(clean.len());
        for mean in &with_background {
            let electrons: f64 = Poisson::new(mean * GAIN_E)?.sample(&mut rng);
            let read: f64 = StandardNormal.sample(&mut rng);
            values.push((electrons + READ_E * read) / GAIN_E);
        }
        let level: f64 = StandardNormal.sample(&mut rng);
        let noisy = Window {
            values: &values,
            background: BACKGROUND + background_sigma * level,
            background_sigma,
            ..reference
        };
        let got = estimate(&noisy, &NOISE)?;
        squares[0] += ((got.x_px - truth.x_px) / got.sigma_x_px).powi(2);
        squares[1] += ((got.y_px - truth.y_px) / got.sigma_y_px).powi(2);
        squares[2] += ((got.flux - truth.flux) / got.sigma_flux).powi(2);
    }
    Ok(squares.map(|sum| sum / f64::from(runs)))
}

/// The mean of 4000 squares of standard normals is 1 +- sqrt(2/4000); 5 of them are 0.112. The
/// formal error takes the photon noise from noisy pixels and leaves out the second order in
/// the ratio of the error to the spot (below 0.03): together less than 0.01.
fn assert_unit(mean_squares: [f64; 3], what: &str) {
    let gate = 5.0 * (2.0 / 4000_f64).sqrt() + 0.01;
    for (axis, square) in mean_squares.into_iter().enumerate() {
        assert!((square - 1.0).abs() < gate, "{what}, {axis}: {square}");
    }
}

#[test]
fn formal_errors_agree_with_monte_carlo() -> Result<(), Boxed> {
    let first = FirstMoment::default();
    let plain = GaussianWeighted::new(0.9);
    let matched = GaussianWeighted::matched(0.9);
    let wide = GaussianWeighted {
        sigma_px: 1.3,
        ..matched
    };
    let mut unread = [false; 49];
    for pixel in [0, 6, 17, 25, 42] {
        unread[pixel] = true;
    }
    for mask in [None, Some(&unread[..])] {
        assert_unit(monte_carlo(|w, n| first.estimate(w, n), mask, 1)?, "first");
        assert_unit(monte_carlo(|w, n| plain.estimate(w, n), mask, 2)?, "plain");
        assert_unit(
            monte_carlo(|w, n| matched.estimate(w, n), mask, 3)?,
            "matched",
        );
        assert_unit(monte_carlo(|w, n| wide.estimate(w, n), mask, 4)?, "wide");
    }
    Ok(())
}

/// With nothing but the background level uncertain, the formal error is `|dx/db| sigma_b`. Central
/// differences over h = 0.02: their error is h^2/6 of the third derivative, relative to dx/db about
/// (h pixels / flux)^2 = (0.02 * 49 / 6000)^2 = 3e-8; steps of 1e-9 px are left by the iteration.
#[test]
fn background_level_enters_the_formal_error() -> Result<(), Boxed> {
    let at = Pixel {
        x: FIRST.x + 3.9,
        y: FIRST.y + 1.6,
    };
    let (values, no_noise) = (spot(7, at, 0.9, 6000.0)?, [0.0; 49]);
    let noise = Noise::Variance(&no_noise);
    let (first, plain) = (FirstMoment::default(), GaussianWeighted::new(0.9));
    let matched = GaussianWeighted::matched(0.9);
    let check = |estimate: &dyn Fn(&Window<'_>) -> Result<CentroidEstimate, CentroidFailure>| {
        let with = |background| {
            estimate(&Window {
                background,
                background_sigma: 3.0,
                ..window(&values, 7)
            })
        };
        let (low, middle, high) = (with(-0.02)?, with(0.0)?, with(0.02)?);
        for (sigma, slope) in [
            (middle.sigma_x_px, (high.x_px - low.x_px) / 0.04),
            (middle.sigma_y_px, (high.y_px - low.y_px) / 0.04),
            (middle.sigma_flux, (high.flux - low.flux) / 0.04),
        ] {
            let expected = 3.0 * slope.abs();
            assert!(expected > 1e-5, "{expected}");
            assert!(
                (sigma - expected).abs() < 1e-4 * expected + 3e-7,
                "{sigma} {expected}"
            );
        }
        Ok::<(), CentroidFailure>(())
    };
    check(&|window| first.estimate(window, &noise))?;
    check(&|window| plain.estimate(window, &noise))?;
    check(&|window| matched.estimate(window, &noise))?;
    Ok(())
}

/// A weight keeps the noise of empty pixels out: less than half the error of the first moment
/// here, and the truncation bias of a spot off the middle is gone.
#[test]
fn weighting_pays() -> Result<(), Boxed> {
    let at = Pixel {
        x: FIRST.x + 3.4,
        y: FIRST.y + 2.7,
    };
    let values = spot(7, at, 0.9, 500.0)?;
    let first = FirstMoment::default().estimate(&window(&values, 7), &NOISE)?;
    let weighted = GaussianWeighted::matched(0.9).estimate(&window(&values, 7), &NOISE)?;
    assert!(weighted.sigma_x_px < 0.5 * first.sigma_x_px);
    let bias = GaussianPsf::new(0.9, 7)?.error_px(0.4);
    assert!((first.x_px - at.x - bias).abs() < 1e-12 && bias.abs() > 1e-3);
    assert!((weighted.x_px - at.x).abs() < 1e-8);
    Ok(())
}

/// Unmodelled, a weight of variance s^2 leaves a sampling error. Weight times pixel-integrated
/// spot has about the variance v = 1/(1/s^2 + 1/(sigma^2 + 1/12)), whose first term in Poisson's sum
/// is 4 pi v exp(-2 pi^2 v); undoing the pull of the weight multiplies by 1 + (sigma^2 + 1/12)/s^2.
/// The pixel's box is no Gaussian of variance 1/12: 10 % of room.
#[test]
fn plain_weight_leaves_the_sampling_error_only() -> Result<(), Boxed> {
    let (sigma, weight) = (0.9_f64, 0.9_f64);
    let spot_variance = sigma * sigma + 1.0 / 12.0;
    let v = 1.0 / (weight.powi(-2) + 1.0 / spot_variance);
    let amplitude =
        (1.0 + spot_variance / weight.powi(2)) * 4.0 * PI * v * (-2.0 * PI * PI * v).exp();
    let mut largest = 0.0_f64;
    for step in -10..=10 {
        let offset = 0.05 * f64::from(step);
        let at = Pixel {
            x: FIRST.x + 5.0 + offset,
            y: FIRST.y + 5.0,
        };
        let values = spot(11, at, sigma, 1e4)?;
        let star = GaussianWeighted::new(weight).estimate(&window(&values, 11), &NOISE)?;
        largest = largest.max((star.x_px - at.x).abs());
        assert!(star.iterations < 15, "{}", star.iterations);
    }
    let ratio = largest / amplitude;
    assert!((ratio - 1.0).abs() < 0.1, "{largest:.2e} {amplitude:.2e}");
    Ok(())
}

/// A spot far narrower than its weight makes the doubled step overshoot: it must still settle.
#[test]
fn narrow_spots_settle() -> Result<(), Boxed> {
    let at = Pixel {
        x: FIRST.x + 3.3,
        y: FIRST.y + 3.1,
    };
    let values = spot(7, at, 0.25, 1e4)?;
    let star = GaussianWeighted::new(1.5).estimate(&window(&values, 7), &NOISE)?;
    assert!((star.x_px - at.x).abs() < 0.3 && star.iterations < 100);
    let model = GaussianWeighted {
        psf_sigma_px: Some(0.25),
        ..GaussianWeighted::new(1.5)
    };
    let star = model.estimate(&window(&values, 7), &NOISE)?;
    assert!((star.x_px - at.x).abs() < 1e-7, "{}", star.x_px - at.x);
    Ok(())
}

#[test]
fn what_has_no_centroid_says_why() -> Result<(), Boxed> {
    let at = Pixel {
        x: FIRST.x + 2.0,
        y: FIRST.y + 2.0,
    };
    let good = spot(5, at, 0.7, 5000.0)?;
    let both = |window: &Window<'_>| {
        [
            FirstMoment::default().estimate(window, &NOISE).err(),
            GaussianWeighted::matched(0.7)
                .estimate(window, &NOISE)
                .err(),
        ]
    };
    assert_eq!(both(&window(&good, 5)), [None, None]);

    let dark = [0.0; 25];
    for failure in both(&window(&dark, 5)) {
        assert_eq!(failure, Some(CentroidFailure::NoFlux { flux: 0.0 }));
    }
    let all = [true; 25];
    let unread = Window {
        unread: Some(&all),
        ..window(&good, 5)
    };
    for failure in both(&unread) {
        assert_eq!(failure, Some(CentroidFailure::TooFewPixels { pixels: 0 }));
    }
    let column: Vec<bool> = (0..25).map(|i| i % 5 != 2).collect();
    let unread = Window {
        unread: Some(&column),
        ..window(&good, 5)
    };
    for failure in both(&unread) {
        assert_eq!(failure, Some(CentroidFailure::TooFewPixels { pixels: 5 }));
    }
    let mut broken = good.clone();
    broken[8] = f64::NAN;
    for failure in both(&window(&broken, 5)) {
        assert!(matches!(
            failure,
            Some(CentroidFailure::Pixel {
                row: 1,
                column: 3,
                ..
            })
        ));
    }
    // the same pixel unread: no failure, whatever it holds
    let mut mask = [false; 25];
    mask[8] = true;
    let masked = Window {
        unread: Some(&mask),
        ..window(&broken, 5)
    };
    assert_eq!(both(&masked), [None, None]);
    let faint = spot(5, at, 0.7, 5.0)?;
    for failure in both(&window(&faint, 5)) {
        assert!(matches!(failure, Some(CentroidFailure::TooFaint { .. })));
    }
    Ok(())
}

#[test]
fn iterations_that_fail_are_failures() -> Result<(), Boxed> {
    let at = Pixel {
        x: FIRST.x + 2.3,
        y: FIRST.y + 1.8,
    };
    let values = spot(5, at, 0.7, 5000.0)?;
    let hasty = GaussianWeighted {
        max_iterations: 2,
        ..GaussianWeighted::new(0.7)
    };
    let failure = hasty.estimate(&window(&values, 5), &NOISE).err();
    assert!(matches!(
        failure,
        Some(CentroidFailure::NotConverged { iterations: 2, .. })
    ));
    // a background taken much too high: the dark side pushes the position off the window
    let pushed: Vec<f64> = [-500., -500., 0., 0., 100.].repeat(5);
    let start = GaussianWeighted {
        start_px: Some([FIRST.x + 4.0, FIRST.y + 2.0]),
        ..GaussianWeighted::new(1.5)
    };
    let failure = start.estimate(&window(&pushed, 5), &NOISE).err();
    assert!(
        matches!(failure, Some(CentroidFailure::OutsideWindow { .. })),
        "{failure:?}"
    );
    let large = vec![1.0; 65 * 65];
    let failure = GaussianWeighted::new(1.0)
        .estimate(&window(&large, 65), &NOISE)
        .err();
    assert_eq!(
        failure,
        Some(CentroidFailure::WindowTooLarge {
            side: 65,
            limit: 64
        })
    );
    // two equal spots, started between them: a place where the moment vanishes, but no maximum
    let mut pair = vec![0.0; 81];
    (pair[37], pair[43]) = (1000.0, 1000.0);
    let between = GaussianWeighted {
        start_px: Some([FIRST.x + 4.0, FIRST.y + 4.0]),
        ..GaussianWeighted::new(1.0)
    };
    let failure = between.estimate(&window(&pair, 9), &NOISE).err();
    assert_eq!(failure, Some(CentroidFailure::NotDetermined));
    Ok(())
}

/// Threshold: pixels at or below it do not count, and the noise in them neither.
#[test]
fn threshold_leaves_pixels_out() -> Result<(), Boxed> {
    let values = [0., 1., 0., 1., 50., 40., 0., 30., 0.];
    let loose = FirstMoment::default().estimate(&window(&values, 3), &NOISE)?;
    let strict = FirstMoment {
        threshold: 1.0,
        ..FirstMoment::default()
    }
    .estimate(&window(&values, 3), &NOISE)?;
    assert_eq!((loose.pixels, strict.pixels), (9, 3));
    assert!((strict.x_px - FIRST.x - 1.0 - 40.0 / 120.0).abs() < 1e-12);
    assert!((strict.y_px - FIRST.y - 1.0 - 30.0 / 120.0).abs() < 1e-12);
    assert!(strict.sigma_x_px < loose.sigma_x_px);
    Ok(())
}

/// A batch equals single windows; a failed one is NaN with its reason and keeps its place.
#[test]
fn batch_equals_single_windows() -> Result<(), Boxed> {
    let (n, columns) = (9, 5);
    let (mut values, mut x0, mut y0, mut background) = (vec![], vec![], vec![], vec![]);
    for i in 0..n {
        let shift = 0.04 * f64::from(i);
        let at = Pixel {
            x: FIRST.x + 2.0 + shift,
            y: FIRST.y + 2.0 - shift,
        };
        let flux = if i == 4 { 0.0 } else { 4000.0 };
        let level = f64::from(i);
        values.extend(spot(columns, at, 0.7, flux)?.iter().map(|v| v + level));
        x0.push(FIRST.x);
        y0.push(FIRST.y);
        background.push(level);
    }
    let variance: Vec<f64> = values.iter().map(|v| 9.0 + v.abs() / 4.0).collect();
    let mut unread = [false; 25];
    unread[24] = true;
    let windows = WindowBatch {
        values: &values,
        columns,
        rows: columns,
        x0_px: &x0,
        y0_px: &y0,
        background: &background,
        background_sigma: 0.5,
        unread: Some(&unread),
    };
    let estimator = GaussianWeighted::matched(0.7);
    for noise in [NOISE, Noise::Variance(&variance)] {
        let [mut x, mut y, mut sx, mut sy, mut flux] = [[0.0; 9]; 5];
        let mut failure = [None; 9];
        let out = EstimatesMut {
            x_px: &mut x,
            y_px: &mut y,
            sigma_x_px: &mut sx,
            sigma_y_px: &mut sy,
            flux: &mut flux,
            failure: &mut failure,
        };
        assert_eq!(estimator.estimate_into(&windows, &noise, out), 1);
        for i in 0..9 {
            let range = 25 * i..25 * (i + 1);
            let single = Window {
                background: background[i],
                background_sigma: 0.5,
                unread: Some(&unread),
                ..window(&values[range.clone()], columns)
            };
            let noise = match noise {
                Noise::Variance(all) => Noise::Variance(&all[range]),
                detector => detector,
            };
            match estimator.estimate(&single, &noise) {
                Ok(star) => {
                    assert_eq!((x[i], y[i], flux[i]), (star.x_px, star.y_px, star.flux));
                    assert_eq!((sx[i], sy[i]), (star.sigma_x_px, star.sigma_y_px));
                    assert_eq!(failure[i], None);
                }
                Err(reason) => {
                    assert_eq!(i, 4);
                    assert_eq!(failure[i], Some(reason));
                    assert!(x[i].is_nan() && sy[i].is_nan() && flux[i].is_nan());
                }
            }
        }
    }
    Ok(())
}

#[test]
fn settings_are_checked() -> Result<(), Boxed> {
    let values = spot(5, Pixel { x: 102.5, y: -5.5 }, 0.7, 5000.0)?;
    let bad_noise = Noise::Detector {
        gain_e: 0.0,
        read_noise_e: 1.0,
        pedestal: 0.0,
    };
    let refused = FirstMoment::default().estimate(&window(&values, 5), &bad_noise);
    assert!(matches!(
        refused,
        Err(CentroidFailure::Setting { name: "gain_e", .. })
    ));
    for sigma in [0.0, -1.0, f64::NAN] {
        let refused = GaussianWeighted::new(sigma).estimate(&window(&values, 5), &NOISE);
        assert!(matches!(refused, Err(CentroidFailure::Setting { .. })));
    }
    Ok(())
}

proptest! {
    /// Exact spots of the declared width come back from any place, phase and mask outside their core.
    #[test]
    fn matched_weight_is_unbiased(
        x in 2.6..3.4_f64, y in 2.6..3.4_f64, sigma in 0.35..1.2_f64, masked in prop::collection::vec(0_usize..49, 0..4)
    ) {
        let at = Pixel { x: FIRST.x + x, y: FIRST.y + y };
        let values = spot(7, at, sigma, 20_000.0).unwrap();
        let mut unread = [false; 49];
        for pixel in masked {
            // light that is not read cannot be weighed: the core of the star stays
            let [column, row] = [(pixel % 7) as f64, (pixel / 7) as f64];
            unread[pixel] = (column - x).hypot(row - y) > 1.6;
        }
        let window = Window { unread: Some(&unread), ..window(&values, 7) };
        let estimator = GaussianWeighted { max_iterations: 2000, ..GaussianWeighted::matched(sigma) };
        let star = estimator.estimate(&window, &NOISE).unwrap();
        // the step limit of 1e-9 px times the slowest contraction's sum
        prop_assert!((star.x_px - at.x).abs() < 1e-6, "{}", star.x_px - at.x);
        prop_assert!((star.y_px - at.y).abs() < 1e-6);
        prop_assert!((star.flux / 20_000.0 - 1.0).abs() < 1e-5);
    }

    /// Moving window and star together moves the centroid; scaling the light does not.
    #[test]
    fn first_moment_is_translated_and_scaled(dx in -400.0..400.0_f64, factor in 0.5..20.0_f64) {
        let at = Pixel { x: FIRST.x + 2.2, y: FIRST.y + 1.9 };
        let values = spot(5, at, 0.8, 3000.0).unwrap();
        let scaled: Vec<f64> = values.iter().map(|v| v * factor).collect();
        let here = FirstMoment::default().estimate(&window(&values, 5), &NOISE).unwrap();
        let there = Window { x0_px: FIRST.x + dx, ..window(&scaled, 5) };
        let moved = FirstMoment::default().estimate(&there, &NOISE).unwrap();
        prop_assert!((moved.x_px - here.x_px - dx).abs() < 1e-11);
        prop_assert!((moved.y_px - here.y_px).abs() < 1e-12);
        prop_assert!((moved.flux / here.flux / factor - 1.0).abs() < 1e-12);
    }
}
