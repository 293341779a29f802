use super::*;
use focal_plane::Pixel;
use star_tracker::StarView;

fn camera() -> Camera {
    let model = telemetry::Model::parse(
        "format = \"boresight-model/1\"\n[tracker]\npixels = [1024, 1024]\nfov_deg = [20.0, 20.0]\n",
        "model.toml",
        &[],
    )
    .unwrap();
    model.camera().unwrap().unwrap()
}

/// Columns of `term` in two rows, x then y.
fn columns(term: &Empirical) -> [Vec<f64>; 2] {
    let nan = [f64::NAN; 2];
    let rows = StarRows {
        t_s: &[1.0, 4.0],
        x_px: &[-100.3, 200.2],
        y_px: &[50.7, -300.1],
        landed_px: [&[-100.3, 200.2], &[50.7, -300.1]],
        landed_variance_px2: [&[0.0; 2]; 2],
        vx_px_s: &[1.0, 0.0],
        vy_px_s: &[2.0, -1.0],
        ax_px_s2: &[0.0; 2],
        ay_px_s2: &[0.0; 2],
        mag: &[3.0, f64::NAN],
        bv: &nan,
        log_flux: &nan,
        log_flux_change: &nan,
        window_px: [&[-100.0, 200.0], &[51.0, -300.0]],
        slot: &[0, 1],
        star_id: &[7, 9],
        waves: None,
        attitude: None,
    };
    let all = 2 * term.coefficients().len();
    let (mut x, mut y) = (vec![0.0; all], vec![0.0; all]);
    let out = PointsMut {
        x: &mut x,
        y: &mut y,
    };
    assert!(term.star_columns(&camera(), &rows, out));
    [x, y]
}

/// A centroid is off by half a pixel at most, and a sawtooth of that has a first harmonic of 1/pi px.
#[test]
fn waves_are_no_larger_than_pixels_let_them_be() {
    let camera = camera();
    let range = [0.0, 1.0];
    let largest = camera.arcsec_per_px()[0] / core::f64::consts::PI;
    let one = Empirical::new(Variable::Phase(0), range, true).unwrap();
    let two = Empirical::pair(Variable::Phase(1), range, Variable::Time, range).unwrap();
    for term in [one.on(&camera), two.on(&camera)] {
        for c in term.coefficients() {
            assert!((c.upper - largest).abs() < 1e-9 && (c.lower + c.upper).abs() < 1e-9);
        }
    }
    let other = Empirical::new(Variable::Time, range, true).unwrap();
    let free = |c: &Coefficient| c.upper.is_infinite();
    assert!(other.on(&camera).coefficients().iter().all(free));
}

#[test]
fn a_pair_is_the_first_columns_of_one_times_the_other() {
    let (whole, range) = ([-2.0, 2.0], [0.0, 4.0]);
    let one = Empirical::new(Variable::Rate, whole, true).unwrap();
    let two = Empirical::pair(Variable::Rate, whole, Variable::Time, range).unwrap();
    // the order of formats.md, whichever multiplies
    assert_eq!(two.name(), "time*rate");
    assert_eq!(two.coefficients().len(), OF_A_PAIR);
    let z = [-0.5, 1.0];
    for (one, two) in columns(&one).iter().zip(columns(&two)) {
        for (k, value) in two.iter().enumerate() {
            assert!((value - z[k % 2] * one[k]).abs() < 1e-15);
        }
    }
    // what is not known shifts nothing
    let by = Empirical::pair(Variable::Rate, whole, Variable::Magnitude, range).unwrap();
    let [x, y] = columns(&by);
    assert!(x[0] != 0.0 && x[1] == 0.0 && y[1] == 0.0);
    let still = Empirical::pair(Variable::Rate, whole, Variable::Time, [3.0, 3.0]);
    assert!(still.is_none());
}

/// A scale may bend in time; what turns whole frames to and fro is a slow error of the reference.
#[test]
fn the_time_bends_the_scale_alone() {
    let time = Empirical::new(Variable::Time, [0.0, 4.0], true).unwrap();
    let [x, y] = columns(&time);
    let acts = |k: usize| {
        x[2 * k..2 * k + 2]
            .iter()
            .chain(&y[2 * k..2 * k + 2])
            .any(|v| *v != 0.0)
    };
    let acting: Vec<usize> = (0..time.coefficients().len())
        .filter(|&k| acts(k))
        .collect();
    assert_eq!(acting, [0, 1, 2, 3, 7, 11]);
    // (x, y) times P_2 of -0.5 and 1
    let [half, _] = camera().half_size_px();
    let scale = 1.0 / camera().arcsec_per_px()[0];
    assert!((x[14] - -0.125 * -100.3 / half * scale).abs() < 1e-12);
    assert!((y[15] - -300.1 / half * scale).abs() < 1e-12);
}

/// A rate of 1 and 2 px/s of at most 2, and one of -1: by its size alone, and in a pair with the place.
#[test]
fn a_motion_drives_by_its_size() {
    let (whole, range) = ([-2.0, 2.0], [-400.0, 400.0]);
    let unit = camera().arcsec_per_px()[0].recip();
    let sizes = [1.25_f64.sqrt(), 0.5];
    for variable in [Variable::Rate, Variable::Acceleration] {
        let alone = Empirical::new(variable.clone(), whole, true).unwrap();
        let pair = Empirical::pair(variable, whole, Variable::Position(0), range).unwrap();
        for (term, at) in [(&alone, SIZE), (&pair, OF_A_PAIR)] {
            assert!(term.parts().contains(&vec![at, at + 1]), "{term:?}");
        }
    }
    let alone = Empirical::new(Variable::Rate, whole, true).unwrap();
    let pair = Empirical::pair(Variable::Rate, whole, Variable::Position(0), range).unwrap();
    let ([x, y], [px, py]) = (columns(&alone), columns(&pair));
    for (row, size) in sizes.into_iter().enumerate() {
        let place = [-100.3, 200.2][row] / 400.0;
        let first = 2 * SIZE + row;
        assert!((x[first] - size * unit).abs() < 1e-14 && y[first].abs() < 1e-14);
        let second = 2 * (OF_A_PAIR + 1) + row;
        assert!((py[second] - place * size * unit).abs() < 1e-14 && px[second].abs() < 1e-14);
    }
}

/// The one row stands left and above, the other right and below: both are of the same pair of quarters. No model
/// can declare them yet.
#[test]
fn halves_and_quarters_have_two_values() {
    let unit = camera().arcsec_per_px()[0].recip();
    let sides = [
        (Variable::Half(0), "x_px", [-1.0, 1.0]),
        (Variable::Half(1), "y_px", [1.0, -1.0]),
        (Variable::Quarter, "x_px*y_px", [-1.0, -1.0]),
    ];
    for (variable, name, values) in sides {
        let term = Empirical::new(variable, [-1.0, 1.0], true).unwrap();
        assert_eq!(term.name(), name);
        let [x, y] = columns(&term);
        for (row, side) in values.into_iter().enumerate() {
            assert!((x[row] - side * unit).abs() < 1e-14 && y[row].abs() < 1e-14);
            assert!((y[2 + row] - side * unit).abs() < 1e-14 && x[2 + row].abs() < 1e-14);
        }
        let channels = BTreeMap::new();
        let surroundings = Surroundings {
            camera: &camera(),
            span_s: [0.0, 4.0],
            channels: &channels,
            frames: None,
        };
        assert!(!term.is_declarable(&surroundings));
    }
}

#[test]
fn harmonics_are_those_of_the_phase() {
    let term = Empirical::new(Variable::Phase(0), [0.0, 1.0], true).unwrap();
    let [x, y] = columns(&term);
    let camera = camera();
    for (row, at) in [-100.3, 200.2].into_iter().enumerate() {
        let phase = camera.phase_rad(at);
        for k in 0..HARMONICS {
            let (sin, cos) = ((k + 1) as f64 * phase).sin_cos();
            let unit = camera.arcsec_per_px()[0].recip();
            // six products of numbers near 1
            assert!((x[4 * k + row] - unit * sin).abs() < 1e-14);
            assert!((x[4 * k + 2 + row] - unit * cos).abs() < 1e-14);
        }
    }
    // across by the first two, and by nothing else
    let own = 2 * HARMONICS * 2;
    assert!(y[..own].iter().all(|v| *v == 0.0));
    let [across, along] = [1, 0].map(|a| camera.arcsec_per_px()[a]);
    for (y, x) in y[own..].iter().zip(&x[..8]) {
        assert!((y * across - x * along).abs() < 1e-14);
    }
    assert!(x[own..].iter().all(|v| *v == 0.0));
}

/// A model that declares what was found shifts stars by what the columns say.
#[test]
fn a_declared_phase_is_the_one_that_was_found() {
    for axis in 0..2 {
        let term = Empirical::new(Variable::Phase(axis), [0.0, 1.0], true).unwrap();
        let count = term.coefficients().len();
        let values: Vec<f64> = (0..count).map(|k| 1.0 + 0.3 * k as f64).collect();
        let (camera, channels) = (camera(), BTreeMap::new());
        let surroundings = Surroundings {
            camera: &camera,
            span_s: [0.0, 4.0],
            channels: &channels,
            frames: None,
        };
        let declared = term.realise(&values, &surroundings).unwrap();
        let columns = columns(&term);
        for (row, (x, y)) in [(-100.3, 50.7), (200.2, -300.1)].into_iter().enumerate() {
            let shift = declared.centroid_shift_px(&StarView {
                t_s: 1.0,
                slot: 0,
                star_id: 7,
                mag: 3.0,
                bv: 0.5,
                at: Pixel { x, y },
            });
            for (column, shift) in columns.iter().zip(shift) {
                let sum: f64 = (0..count).map(|k| values[k] * column[2 * k + row]).sum();
                assert!((sum - shift).abs() < 1e-12, "{axis}: {sum} {shift}");
            }
        }
    }
}

#[test]
fn single_stars_are_tried_and_all() {
    let term = Empirical::new(Variable::Star(vec![7, 9]), [0.0, 1.0], true).unwrap();
    assert_eq!(term.parts(), [vec![0, 1], vec![2, 3], vec![0, 1, 2, 3]]);
    let line = Empirical::new(Variable::Magnitude, [3.0, 5.0], true).unwrap();
    let counts: Vec<usize> = line.parts().iter().map(Vec::len).collect();
    // a straight line, what bends alone, the scale, everything
    assert_eq!(counts, [2, 4, 2, 4, 1, 12]);
    let window = Empirical::new(Variable::Window, [-0.5, 0.5], true).unwrap();
    let [x, y] = columns(&window);
    let unit = camera().arcsec_per_px()[0].recip();
    // 0.3 px left of the middle along x, and along y
    assert!((x[0] + 0.6 * unit).abs() < 1e-12 && x[2] == 0.0);
    assert!((y[2] + 0.6 * unit).abs() < 1e-12 && y[0] == 0.0);
}

/// What is kept of a motion hides no time tag and no rolling shutter, of a number no field that is not described.
#[test]
fn what_bends_as_well_hides_no_effect() {
    let range = [-2.0, 2.0];
    let rate = Empirical::new(Variable::Rate, range, true).unwrap();
    let curved: Vec<usize> = (SQUARES..OF_A_RATE).collect();
    assert_eq!(rate.bending(&[SIZE]), curved);
    assert_eq!(rate.bending(&[4, SIZE])[0], 4, "but what is meant");
    let colour = Empirical::new(Variable::Colour, range, true).unwrap();
    assert_eq!(
        colour.bending(&[4]),
        [0, 4, 8],
        "the same field, of any order"
    );
    let stars = Empirical::new(Variable::Star(vec![7, 9]), range, true).unwrap();
    assert_eq!(stars.bending(&[2, 3]), [2, 3]);
    let phase = Empirical::new(Variable::Phase(0), range, true).unwrap();
    assert_eq!(phase.bending(&[0]).len(), phase.coefficients().len());
}

/// Of what is known: four magnitudes, most of them faint.
#[test]
fn a_range_about_the_mean_holds_all_values() {
    let [low, high] = about_mean([2.0, f64::NAN, 6.0, 6.0, 6.0].into_iter());
    assert!((0.5 * (low + high) - 5.0).abs() < 1e-12);
    assert!((low - 2.0).abs() < 1e-12 && (high - 8.0).abs() < 1e-12);
    // of nothing there is no range
    let [low, high] = about_mean([f64::NAN].into_iter());
    assert!(low >= high || !low.is_finite());
}

/// A star that follows the only channel that there is was looked for all the same, at no price; an instant of many pays.
#[test]
fn what_was_looked_for_among_one_was_looked_for() {
    let pair = || {
        let star = Variable::Star(vec![7]);
        Empirical::pair(star, [0.0, 1.0], Variable::Time, [0.0, 1.0]).expect("a range")
    };
    assert!(!pair().is_looked_for());
    let one = pair().looked_for_among(1);
    assert!(one.is_looked_for() && one.scanned().abs() < 1e-12);
    let many = pair().looked_for_among(20);
    assert!((many.scanned() - 20.0_f64.ln()).abs() < 1e-12);
}
