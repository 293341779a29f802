//! The presets of [A01], and what may be wrong with a record.

use assess::{Assessment, Options, Term, assess, misalignment_123};
use focal_plane::{AttitudeSource, rotation_from_vector};
use nalgebra::{UnitQuaternion, Vector3};
use scenarios::{Motion, Scenario, preset, simulate, simulate_with_truth};
use telemetry::Bundle;
use telemetry::report::{AssessMethod, Verdict};

const ALIGNMENT: [[f64; 3]; 3] = [
    [0.386710, -0.908103, -0.160635],
    [-0.922202, -0.380781, -0.067459],
    [0.000094, 0.174225, -0.984706],
];

fn scenario(name: &str, seed: u64) -> Scenario {
    let mut scenario = preset(name).and_then(|p| p.scenario()).expect("a preset");
    scenario.run.seed = seed;
    scenario
}

fn image(seed: u64) -> Bundle {
    simulate(&scenario("image", seed)).expect("a bundle")
}

fn known() -> Options {
    Options {
        inertia: Some([14710.5, 14688.8, 29041.9]),
        alignment: Some(ALIGNMENT),
        requirement_arcsec: Some(360.0),
        ..Options::default()
    }
}

fn run(bundle: &Bundle, options: &Options) -> Assessment {
    assess(bundle, options, &|_| ()).expect("an assessment")
}

fn near(value: f64, truth: f64, tolerance: f64, what: &str) {
    assert!(
        (value - truth).abs() <= tolerance,
        "{what}: {value}, truth {truth} +- {tolerance}"
    );
}

/// The angular momentum of the preset: of its body without the booms' swinging, at t = 0.
fn spin_axis_deg() -> [f64; 2] {
    let mut still = scenario("image", 21);
    let Motion::Rotator(rotator) = &mut still.motion else {
        panic!("a rotator")
    };
    rotator.sinusoid.clear();
    let [ix, iy, iz] = rotator.inertia_kg_m2;
    still.run.duration_s = Some(1.0);
    let truth = simulate_with_truth(&still, 0).expect("a flight").truth;
    let n = assess::alignment(ALIGNMENT).expect("an alignment");
    let m = misalignment_123(0.2032_f64.to_radians(), (-0.1050_f64).to_radians());
    let rate = truth.rate_rad_s(0.0).expect("a rate");
    let body = (n * m * rate).component_mul(&Vector3::new(ix, iy, iz));
    let l = truth.attitude(0.0).expect("an attitude").inverse() * ((n * m).inverse() * body);
    [l.y.atan2(l.x), l.z.atan2(l.x.hypot(l.y))].map(f64::to_degrees)
}

/// Each of three draws: spin axis in inertial space, misalignment, triaxiality and white noise within five of
/// their own sigmas; the body's axis in the tracker within five times what the misalignment's sigma says
/// (0.05 arcsec). What the aligned
/// axisymmetric body leaves is 61, 67 and 80 to 88 arcsec about body axes as [A01] prints, within 3: the
/// preset was made to. The mean before alignment is 0.2 deg: hypot(0.2032, 0.1050) = 0.229 turned.
#[test]
fn image_is_recovered() {
    for seed in [21, 1, 2] {
        let found = run(&image(seed), &known());
        assert_eq!(found.report.method, AssessMethod::RigidRotator);
        let rotator = found.rotator.as_ref().unwrap();
        let [ra, dec] = spin_axis_deg();
        let truth = [
            ("spin_axis_ra_deg", ra.rem_euclid(360.0)),
            ("spin_axis_dec_deg", dec),
            ("phi_deg", 0.2032),
            ("theta_deg", -0.1050),
            ("a", 21.7 / 29399.3),
            ("b", 0.0),
        ];
        let parameters = rotator.parameters();
        for (name, truth) in truth {
            let p = parameters.iter().find(|p| p.name == name).unwrap();
            near(
                p.estimate.value,
                truth,
                5.0 * p.estimate.sigma.unwrap(),
                name,
            );
        }
        // body z in the tracker: M^T N^T e_z
        let n = assess::alignment(ALIGNMENT).unwrap();
        let m = misalignment_123(0.2032_f64.to_radians(), (-0.1050_f64).to_radians());
        let z = (n * m).inverse() * Vector3::z();
        let last = rotator.closing.last.model.to_body.inverse() * Vector3::z();
        assert!((z - last).norm() * 206_265.0 < 0.5, "{seed}");
        let [x, y, _] = rotator.mean_before_deg;
        near(x.hypot(y), 0.229, 0.01, "mean before");
        for (axis, (got, printed)) in rotator
            .body_arcsec
            .iter()
            .zip([61.0, 67.0, 86.0])
            .enumerate()
        {
            near(*got, printed, 3.0, &format!("axis {axis}"));
        }
        let (value, error) = (
            found.report.inherent_arcsec.unwrap(),
            found.report.inherent_sigma_arcsec.unwrap(),
        );
        for (axis, truth) in [2.0, 2.0, 22.9].into_iter().enumerate() {
            near(value[axis], truth, 5.0 * error[axis], "inherent");
        }
        assert!(found.requirement.unwrap().met_at_three_sigma);
        // three booms, found to a hundredth of what the record resolves, and the body's own asymmetry
        let mut lines: Vec<f64> = rotator
            .closing
            .last
            .model
            .oscillations
            .iter()
            .map(|l| l.frequency_hz)
            .collect();
        lines.sort_by(f64::total_cmp);
        assert_eq!(lines.len(), 3, "{lines:?}");
        for (got, truth) in lines.iter().zip([0.0058, 0.0066, 0.0073]) {
            near(*got, truth, 0.01 / 1800.0, "line");
        }
        let terms: Vec<Term> = rotator.closing.added.iter().map(|a| a.term).collect();
        assert_eq!(terms[0], Term::Misalignment);
        assert!(terms.contains(&Term::Triaxiality));
        assert_eq!(
            found.document().rotator.unwrap().closing.verdict,
            Verdict::Explained
        );
        // what is triaxial is removed: white noise is left, to five sigma of an rms of 3600, and the
        // prediction of the other folds costs a few percent
        let triaxial = rotator
            .closing
            .added
            .iter()
            .find(|a| a.term == Term::Triaxiality)
            .unwrap();
        assert!(triaxial.before_arcsec[0] > triaxial.after_arcsec[0] + 0.1);
        for (after, truth) in triaxial.after_arcsec.iter().zip([2.0, 2.0, 22.9]) {
            assert!(
                after / truth < 1.0 + 5.0 / f64::sqrt(7200.0) + 0.03,
                "{after}"
            );
        }
    }
}

/// A long record: 24 000 frames at 40 Hz of a body that spins, more than are fitted. Every second one is, the
/// noise is that of all, known to 1/sqrt(2 n) and a little more; the table of residuals fits its own times.
#[test]
fn a_long_record_is_thinned_for_the_fit_alone() {
    let mut long = scenario("image", 5);
    long.run.duration_s = Some(600.0);
    long.run.rate_hz = Some(40.0);
    if let Motion::Rotator(rotator) = &mut long.motion {
        rotator.sinusoid.clear();
    }
    let found = run(&simulate(&long).expect("a bundle"), &known());
    assert_eq!(found.counts.used, 24_000);
    assert_eq!(found.t_s.len(), 24_000);
    let table = found.residuals().unwrap();
    assert_eq!(table.t_s.len(), 12_000);
    assert_eq!(table.before_arcsec[2].len(), 12_000);
    assert!(
        found
            .notes
            .iter()
            .any(|n| n.contains("one frame of every 2,"))
    );
    let noise = found.report.inherent_arcsec.unwrap();
    for (got, truth) in noise.into_iter().zip([2.0, 2.0, 22.9]) {
        near(got, truth, 5.0 * 2.0 * truth / f64::sqrt(48_000.0), "noise");
    }
}

/// Without inertia and alignment: the ratio comes from the nutation, the rest is as before.
#[test]
fn nothing_but_quaternions_is_enough() {
    let found = run(&image(3), &Options::default());
    let rotator = found.rotator.as_ref().unwrap();
    assert!(rotator.start.ratio_seen);
    let ratio = rotator.closing.last.model.body.inertia.axial_ratio;
    near(ratio, 2.0 * 29041.9 / 29399.3, 5e-6, "I3/IT");
    near(
        rotator.closing.last.model.body.nutation_rad().to_degrees(),
        0.7,
        0.002,
        "nutation",
    );
    near(
        found.report.inherent_arcsec.unwrap()[0],
        2.0,
        0.15,
        "inherent",
    );
}

/// Sign flips mean nothing, outliers and gaps are counted, and the figures stay. One frame in a hundred
/// is 5000 arcsec off; a frame that is left out moves an rms by less than a percent.
#[test]
fn flips_gaps_and_outliers_are_handled_and_counted() {
    let clean = image(4);
    let mut bundle = clean.clone();
    let table = bundle.attitude.as_mut().unwrap();
    let mut hurt = 0;
    for (k, q) in table.q.iter_mut().enumerate() {
        if k % 100 == 37 {
            let turn = Vector3::new(0.024, -0.01, 0.02) * if k % 200 == 37 { 1.0 } else { -1.0 };
            *q = rotation_from_vector(&turn) * *q;
            hurt += 1;
        }
        if k % 7 == 3 {
            *q = UnitQuaternion::new_unchecked(-q.into_inner());
        }
    }
    let keep = |k: &usize| !(1000..1040).contains(k) && !(2500..2800).contains(k);
    let rows: Vec<usize> = (0..table.t_s.len()).filter(keep).collect();
    let lost = (0..table.t_s.len())
        .filter(|k| !keep(k) && k % 100 == 37)
        .count();
    table.t_s = rows.iter().map(|k| table.t_s[*k]).collect();
    table.q = rows.iter().map(|k| table.q[*k]).collect();
    let (a, b) = (run(&clean, &known()), run(&bundle, &known()));
    assert_eq!(b.counts.outliers, hurt - lost);
    assert_eq!(b.counts.gaps, 2);
    near(b.counts.longest_gap_s, 150.5, 1e-6, "gap");
    assert!(b.counts.sign_flips > 800);
    assert_eq!(a.counts.sign_flips + a.counts.outliers + a.counts.gaps, 0);
    for axis in 0..3 {
        let pair = [&a, &b].map(|x| x.report.total_arcsec.unwrap()[axis]);
        near(pair[1], pair[0], 0.1 * pair[0], "total");
        let noise = b.report.inherent_arcsec.unwrap()[axis];
        let truth = [2.0, 2.0, 22.9][axis];
        near(
            noise,
            truth,
            5.0 * b.report.inherent_sigma_arcsec.unwrap()[axis],
            "inherent",
        );
    }
}

/// Above 0.6 rpm and above 1 rpm the reader is told; a turn of 150 deg between frames is an error.
#[test]
fn a_fast_spin_is_told() {
    let at = |rpm: f64, rate_hz: f64| {
        let mut scenario = scenario("image", 1);
        if let Motion::Rotator(rotator) = &mut scenario.motion {
            rotator.spin_rpm = rpm;
        }
        scenario.run.rate_hz = Some(rate_hz);
        scenario.run.duration_s = Some(600.0);
        assess(&simulate(&scenario).unwrap(), &known(), &|_| ())
    };
    let notes = |rpm| at(rpm, 2.0).unwrap().notes.join("; ");
    assert!(!notes(0.5).contains("rpm"));
    assert!(notes(0.8).contains("above 0.6 rpm"));
    assert!(notes(1.5).contains("above 1 rpm"));
    let error = at(5.0, 0.2).unwrap_err().to_string();
    assert!(error.contains("150 deg"), "{error}");
}

/// EO-1: bias within five sigma of the truth, where what wanders is the gyro alone; then the preset with
/// its steps, whose total and quiet noise are those of Tables 1 and 2 within 10 percent and five sigma.
#[test]
fn eo1_has_its_bias_and_its_noise() {
    let mut square = 0.0;
    for seed in 0..8 {
        let mut quiet = scenario("eo1", seed);
        quiet.model.effects.clear();
        let found = run(&simulate(&quiet).unwrap(), &Options::default());
        let gyro = found.gyro.as_ref().unwrap();
        for (axis, truth) in [0.6, -0.9, 0.4].into_iter().enumerate() {
            let z = (gyro.bias_arcsec_s[axis] - truth) / gyro.bias_sigma_arcsec_s[axis];
            square += z * z / 24.0;
            assert!(z.abs() < 5.0, "seed {seed}, axis {axis}: {z}");
        }
        // 0.03 arcsec/s each second; it is known to about a tenth
        near(gyro.walk_arcsec_rt_s, 0.03, 0.015, "walk");
    }
    // chi-squared of 24: 1 +- 0.29
    assert!((0.2..2.5).contains(&square), "{square}");
    let found = run(
        &simulate(&scenario("eo1", 23)).unwrap(),
        &Options::default(),
    );
    assert_eq!(found.report.method, AssessMethod::Gyro);
    for axis in 0..3 {
        let printed = [6.2, 6.9, 18.1][axis];
        near(
            found.report.total_arcsec.unwrap()[axis],
            printed,
            0.1 * printed,
            "total",
        );
        let (value, error) = (
            found.report.inherent_arcsec.unwrap()[axis],
            found.report.inherent_sigma_arcsec.unwrap()[axis],
        );
        near(value, [1.7, 1.7, 11.6][axis], 5.0 * error, "inherent");
    }
}

/// Frames beyond the gyro are counted, and a hole in the gyro makes two stretches.
#[test]
fn a_hole_in_the_gyro_is_not_bridged() {
    let mut bundle = simulate(&scenario("eo1", 5)).unwrap();
    let rates = bundle.rates.as_mut().unwrap();
    let rows: Vec<usize> = (0..rates.t_s.len())
        .filter(|k| !(3000..3100).contains(k) && *k < 8000)
        .collect();
    rates.t_s = rows.iter().map(|k| rates.t_s[*k]).collect();
    rates.w = rows.iter().map(|k| rates.w[*k]).collect();
    let found = run(&bundle, &Options::default());
    assert_eq!(found.gyro.as_ref().unwrap().stretches, 2);
    assert!(
        found.counts.outside > 350 && found.counts.outside < 400,
        "{:?}",
        found.counts
    );
    assert!(found.notes.iter().any(|n| n.contains("2 stretches")));
    near(
        found.report.inherent_arcsec.unwrap()[0],
        1.7,
        0.1,
        "inherent",
    );
}

/// A method whose table is missing is named.
#[test]
fn a_missing_table_is_named() {
    let options = Options {
        method: Some(AssessMethod::Gyro),
        ..Options::default()
    };
    let error = assess(&image(1), &options, &|_| ())
        .unwrap_err()
        .to_string();
    assert!(error.contains("`rates`"), "{error}");
}
