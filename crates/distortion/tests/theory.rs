//! Errata, exact sizes, batches, fits and their errors.

#![expect(clippy::float_cmp, reason = "compared where the result is exact")]

use distortion::{DistortionError, DistortionField, FieldFit, LsfSigma, MAX_ORDER};
use focal_plane::{Angle, Camera, Normalised, Pixel, Points, PointsMut};
use proptest::prelude::*;
use rand_distr::{Distribution, StandardNormal, Uniform};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

fn rng(seed: u64) -> Xoshiro256PlusPlus {
    Xoshiro256PlusPlus::seed_from_u64(seed)
}

fn circular(arcsec: f64) -> LsfSigma {
    LsfSigma::Circular(Angle::from_arcsec(arcsec))
}

fn spread(rows: usize, seed: u64) -> Result<[Vec<f64>; 2], rand_distr::uniform::Error> {
    let mut rng = rng(seed);
    let side = Uniform::new(-1.0, 1.0)?;
    let mut column = || side.sample_iter(&mut rng).take(rows).collect();
    Ok([column(), column()])
}

/// Erratum E1: Eq. 8 as it stands, y^T A x, against the double sum of Eq. 5 with `a_jk`. As
/// printed, Eq. 5 makes the first index the power of x; put back, the transpose, this fails.
#[test]
fn row_of_a_is_the_power_of_y() -> Result<(), DistortionError> {
    let order = 2;
    let a: Vec<f64> = (0..9).map(f64::from).collect();
    let field = DistortionField::from_coefficients(order, &a, &[0.0; 9])?;
    let (x, y) = (0.5_f64, -0.25_f64);
    let (mut eq_8, mut transposed) = (0.0, 0.0);
    for (j, y_j) in [1.0, y, y * y].into_iter().enumerate() {
        for (k, x_k) in [1.0, x, x * x].into_iter().enumerate() {
            eq_8 += y_j * a[3 * j + k] * x_k;
            transposed += y_j * a[3 * k + j] * x_k;
        }
    }
    let [got, _] = field.evaluate(Normalised { x, y });
    assert!((got - eq_8).abs() < 1e-15, "{got} {eq_8}");
    assert!((got - transposed).abs() > 0.1);
    // one entry alone: row 1, column 0 is y, and nothing of x
    let single = DistortionField::from_coefficients(1, &[0., 0., 1., 0.], &[0.0; 4])?;
    assert_eq!(single.evaluate(Normalised { x: 0.3, y: 0.7 }), [0.7, 0.0]);
    Ok(())
}

/// Erratum E15: 3.1667 arcsec is circular, 2.239 per axis; the axes together give it back.
#[test]
fn draw_has_the_declared_circular_size() -> Result<(), DistortionError> {
    for seed in 0..20 {
        let field = DistortionField::draw(7, Angle::from_arcsec(3.1667).into(), &mut rng(seed))?;
        let [x, y] = field.rms_arcsec();
        assert!((x - 3.1667 / 2_f64.sqrt()).abs() < 1e-12, "{seed}: {x}");
        assert!((y - 3.1667 / 2_f64.sqrt()).abs() < 1e-12, "{seed}: {y}");
        let per_axis = LsfSigma::PerAxis(Angle::from_arcsec(3.1667));
        let [x, _] = DistortionField::draw(7, per_axis, &mut rng(seed))?.rms_arcsec();
        assert!((x - 3.1667).abs() < 1e-12);
    }
    Ok(())
}

/// The paper's rectangular mesh agrees with the exact moments. Its error is at most
/// h^2/24 times the sum of both second derivatives, here of F^2: the difference must fall fourfold as h halves.
#[test]
fn mesh_converges_to_the_exact_size() -> Result<(), DistortionError> {
    let field = DistortionField::draw(7, circular(2.0), &mut rng(3))?;
    let mesh_error = |n: u32| {
        let h = 2.0 / f64::from(n);
        let place = |i: u32| -1.0 + (f64::from(i) + 0.5) * h;
        let (mut sum, mut square) = (0.0, 0.0);
        for j in 0..n {
            for k in 0..n {
                let (x, y) = (place(k), place(j));
                let [f1, _] = field.evaluate(Normalised { x, y });
                sum += f1;
                square += f1 * f1;
            }
        }
        let cells = f64::from(n) * f64::from(n);
        (sum / cells, square / cells - 2.0)
    };
    let (mean, square) = mesh_error(400);
    let (finer_mean, finer_square) = mesh_error(800);
    assert!(mean.abs() < 1e-3 && square.abs() < 1e-2, "{mean} {square}");
    assert!(
        (mean / finer_mean - 4.0).abs() < 0.02,
        "{mean} {finer_mean}"
    );
    assert!((square / finer_square - 4.0).abs() < 0.02);
    Ok(())
}

#[test]
fn nothing_silent_when_a_draw_cannot_be_made() -> Result<(), DistortionError> {
    let draw = |order, sigma| DistortionField::draw(order, circular(sigma), &mut rng(1));
    assert!(matches!(
        draw(0, 1.0),
        Err(DistortionError::NothingToScale { order: 0, .. })
    ));
    assert!(matches!(
        draw(MAX_ORDER + 1, 1.0),
        Err(DistortionError::Order { .. })
    ));
    for sigma in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(matches!(draw(7, sigma), Err(DistortionError::Sigma { .. })));
    }
    let zero = draw(7, 0.0)?;
    assert_eq!(zero.evaluate(Normalised { x: 0.3, y: 0.9 }), [0.0, 0.0]);
    assert_eq!(draw(0, 0.0)?, DistortionField::zero());
    Ok(())
}

#[test]
fn coefficients_are_checked() {
    let wrong = DistortionField::from_coefficients(2, &[0.0; 9], &[0.0; 8]);
    assert_eq!(
        wrong,
        Err(DistortionError::Coefficients {
            axis: 'y',
            got: 8,
            need: 9
        })
    );
    let mut a = [0.0; 9];
    a[5] = f64::INFINITY;
    let wrong = DistortionField::from_coefficients(2, &a, &[0.0; 9]);
    assert_eq!(
        wrong,
        Err(DistortionError::Coefficient {
            axis: 'x',
            power_x: 2,
            power_y: 1,
            value: f64::INFINITY
        })
    );
}

/// Formal sigma of the fitted field against the scatter of 400 fits: the ratio of variances of
/// 400 normal deviates is within 5 sqrt(2/400) = 0.354 of one.
#[test]
fn formal_sigma_of_a_fit_agrees_with_monte_carlo() -> Result<(), Box<dyn std::error::Error>> {
    let (rows, runs, noise) = (300, 400_u32, 0.7);
    let [x, y] = spread(rows, 11)?;
    let truth = DistortionField::draw(4, circular(2.0), &mut rng(12))?;
    let at = Normalised { x: 0.6, y: -0.4 };
    let mut rng = rng(13);
    let (mut sum, mut formal) = ([0.0; 2], [0.0; 2]);
    for _ in 0..runs {
        let (mut dx, mut dy) = (vec![0.0; rows], vec![0.0; rows]);
        truth.evaluate_into(
            Points { x: &x, y: &y },
            PointsMut {
                x: &mut dx,
                y: &mut dy,
            },
        );
        for value in dx.iter_mut().chain(&mut dy) {
            let draw: f64 = StandardNormal.sample(&mut rng);
            *value += noise * draw;
        }
        let fit = FieldFit::new(4, Points { x: &x, y: &y }, Points { x: &dx, y: &dy }, None)?;
        let (got, true_value) = (fit.field.evaluate(at), truth.evaluate(at));
        let sigma = fit.sigma_arcsec(at).ok_or("degrees of freedom are left")?;
        for axis in 0..2 {
            sum[axis] += (got[axis] - true_value[axis]).powi(2);
            formal[axis] += sigma[axis].powi(2);
        }
    }
    let gate = 5.0 * (2.0 / f64::from(runs)).sqrt();
    for axis in 0..2 {
        let ratio = sum[axis] / formal[axis];
        assert!((ratio - 1.0).abs() < gate, "axis {axis}: {ratio}");
    }
    Ok(())
}

#[test]
fn a_fit_says_what_it_cannot_do() -> Result<(), Box<dyn std::error::Error>> {
    let [x, y] = spread(100, 5)?;
    let zeros = [0.0; 100];
    let flat = Points {
        x: &zeros,
        y: &zeros,
    };
    let fit = |order, at: Points<'_>, residual: Points<'_>| {
        FieldFit::new(order, at, residual, None).map(|fit| fit.condition)
    };
    assert!(matches!(
        fit(10, Points { x: &x, y: &y }, flat),
        Err(DistortionError::TooFewRows {
            got: 100,
            need: 121
        })
    ));
    // all stars on one line: x and y cannot be told apart
    assert!(matches!(
        fit(3, Points { x: &x, y: &x }, flat),
        Err(DistortionError::IllConditioned { order: 3, .. })
    ));
    let pixels: Vec<f64> = x.iter().map(|x| 512.0 * x).collect();
    assert!(matches!(
        fit(3, Points { x: &pixels, y: &y }, flat),
        Err(DistortionError::OffField { row: 0, .. })
    ));
    let mut broken = zeros;
    broken[17] = f64::NAN;
    assert!(matches!(
        fit(
            3,
            Points { x: &x, y: &y },
            Points {
                x: &zeros,
                y: &broken
            }
        ),
        Err(DistortionError::Row { row: 17, .. })
    ));
    let mut weights = [1.0; 100];
    weights[3] = 0.0;
    assert!(matches!(
        FieldFit::new(2, Points { x: &x, y: &y }, flat, Some(&weights)).map(|fit| fit.condition),
        Err(DistortionError::Row {
            row: 3,
            name: "weight",
            ..
        })
    ));
    Ok(())
}

/// More rows than one block of the triangularisation, and an exact field: back to rounding.
/// The way to monomials of order 15 has entries up to 1e5 on each axis: 1e-16 * 1e10.
#[test]
fn high_orders_and_several_blocks_are_fitted() -> Result<(), Box<dyn std::error::Error>> {
    for order in [0, 7, MAX_ORDER] {
        let [x, y] = spread(3000, 21)?;
        let sigma = if order == 0 { 0.0 } else { 2.0 };
        let truth = DistortionField::draw(order, circular(sigma), &mut rng(22))?;
        let (mut dx, mut dy) = (vec![0.0; 3000], vec![0.0; 3000]);
        truth.evaluate_into(
            Points { x: &x, y: &y },
            PointsMut {
                x: &mut dx,
                y: &mut dy,
            },
        );
        let fit = FieldFit::new(
            order,
            Points { x: &x, y: &y },
            Points { x: &dx, y: &dy },
            None,
        )?;
        let worst = x.iter().zip(&y).fold(0.0_f64, |worst, (&x, &y)| {
            let at = Normalised { x, y };
            let (got, want) = (fit.field.evaluate(at), truth.evaluate(at));
            worst.max((got[0] - want[0]).hypot(got[1] - want[1]))
        });
        assert!(worst < 1e-6, "order {order}: {worst:.1e}");
        assert!(fit.residual_rms_arcsec[0] < 1e-12);
        assert!(order == MAX_ORDER || fit.condition < 5.0);
    }
    Ok(())
}

#[test]
fn a_steep_field_cannot_be_undone_and_says_so() -> Result<(), Box<dyn std::error::Error>> {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0])?;
    // -2 px of displacement for each px: substitution diverges
    let slope = -2.0 * 512.0 * camera.arcsec_per_px()[0];
    let field = DistortionField::from_coefficients(1, &[0., slope, 0., 0.], &[0.0; 4])?;
    let (mut x, mut y) = ([0.0], [0.0]);
    let failed = field.for_camera(&camera).undistort_into(
        Points {
            x: &[100.0],
            y: &[0.0],
        },
        PointsMut {
            x: &mut x,
            y: &mut y,
        },
    );
    assert!(matches!(
        failed,
        Err(DistortionError::NotConverged { row: 0, .. })
    ));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// A batch equals single calls to the last bit, wherever it is cut; NaN stays NaN.
    #[test]
    fn batch_equals_single_calls(order in 0_usize..=15, rows in 0_usize..40, seed in 0_u64..1000) {
        let sigma = if order == 0 { 0.0 } else { 1.0 };
        let field = DistortionField::draw(order, circular(sigma), &mut rng(seed)).unwrap();
        let [mut x, y] = spread(rows, seed).unwrap();
        if let Some(first) = x.first_mut() {
            *first = f64::NAN;
        }
        let (mut dx, mut dy) = (vec![0.0; rows], vec![0.0; rows]);
        let out = PointsMut { x: &mut dx, y: &mut dy };
        field.evaluate_into(Points { x: &x, y: &y }, out);
        for i in 0..rows {
            let [one_x, one_y] = field.evaluate(Normalised { x: x[i], y: y[i] });
            prop_assert_eq!(dx[i].to_bits(), one_x.to_bits());
            prop_assert_eq!(dy[i].to_bits(), one_y.to_bits());
            prop_assert_eq!(dx[i].is_nan(), i == 0);
        }
    }

    /// The field is linear in its coefficients, and the basis is its derivative.
    #[test]
    fn basis_spans_the_field(order in 1_usize..=15, seed in 0_u64..1000, x in -1.0..1.0, y in -1.0..1.0) {
        let field = DistortionField::draw(order, circular(1.0), &mut rng(seed)).unwrap();
        let other = DistortionField::draw(2, circular(0.5), &mut rng(seed + 1)).unwrap();
        let mut basis = vec![0.0; (order + 1) * (order + 1)];
        let at = Normalised { x, y };
        DistortionField::basis_into(order, at, &mut basis);
        let by_hand: f64 = basis.iter().zip(field.a()).map(|(b, a)| a * b).sum();
        let [f1, f2] = field.evaluate(at);
        prop_assert!((f1 - by_hand).abs() < 1e-12);
        let sum = field.plus(&other).evaluate(at);
        let [g1, g2] = other.evaluate(at);
        prop_assert!((sum[0] - f1 - g1).abs() < 1e-12 && (sum[1] - f2 - g2).abs() < 1e-12);
        let [h1, _] = field.scaled(-3.0).evaluate(at);
        prop_assert!((h1 + 3.0 * f1).abs() < 1e-12);
    }

    /// There and back in pixels: the step limit and the rounding of 512 px.
    #[test]
    fn undistorting_undoes_distorting(seed in 0_u64..1000, x in -500.0..500.0, y in -500.0..500.0) {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let field = DistortionField::draw(7, circular(30.0), &mut rng(seed)).unwrap();
        let lens = field.for_camera(&camera);
        let (mut there_x, mut there_y) = ([0.0], [0.0]);
        lens.distort_into(
            Points { x: &[x], y: &[y] },
            PointsMut { x: &mut there_x, y: &mut there_y },
        );
        let [shift_x, shift_y] = field
            .evaluate(Normalised { x: x / 512.0, y: y / 512.0 })
            .map(|arcsec| arcsec / camera.arcsec_per_px()[0]);
        prop_assert!((there_x[0] - x - shift_x).abs() < 1e-12);
        prop_assert!((there_y[0] - y - shift_y).abs() < 1e-12);
        let [single, _] = lens.shift_px(Pixel { x, y });
        prop_assert!((single - shift_x).abs() < 1e-12);
        let (mut back_x, mut back_y) = ([0.0], [0.0]);
        lens.undistort_into(
            Points { x: &there_x, y: &there_y },
            PointsMut { x: &mut back_x, y: &mut back_y },
        )
        .unwrap();
        prop_assert!((back_x[0] - x).abs() < 2e-12 && (back_y[0] - y).abs() < 2e-12);
    }
}
