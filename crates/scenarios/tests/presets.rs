//! The presets hold what the paper prints, and say of everything else that it is assumed.

use focal_plane::{AttitudeSource, Pixel};
use nalgebra::Vector3;
use scenarios::{
    Channel, Motion, PRESETS, Preset, Scenario, Simulated, preset, simulate, simulate_with_truth,
};

fn shortened(name: &str, duration_s: f64) -> Scenario {
    let mut scenario = preset(name).and_then(Preset::scenario).expect("a preset");
    scenario.run.duration_s = Some(duration_s);
    scenario
}

/// Motion of a star in the middle of the field, px, between two times.
fn moved(made: &Simulated, from_s: f64, to_s: f64) -> Pixel {
    let camera = made.pbm.camera();
    let at = |t| made.truth.attitude(t).expect("in span");
    let star = at(from_s).inverse() * Vector3::z();
    camera.project(&(at(to_s) * star)).expect("in front")
}

/// Presets of \[M23\]: one tracker.
fn of_the_first_paper() -> impl Iterator<Item = &'static Preset> {
    let other = ["image", "eo1"];
    PRESETS.iter().filter(move |p| !other.contains(&p.name))
}

#[test]
fn every_preset_makes_a_bundle() {
    for preset in of_the_first_paper() {
        let made = simulate(&shortened(preset.name, 20.0)).unwrap();
        assert_eq!(made.attitude.unwrap().t_s.len(), 200, "{}", preset.name);
        let stars = made.stars.unwrap();
        let expected = if preset.name.contains("ict") { 15 } else { 14 };
        assert_eq!(stars.rows(), 200 * expected, "{}", preset.name);
        assert!(made.reference.is_some());
    }
}

/// Table 1, and the numbers of sections 4.1 and 4.2 that are the same everywhere.
#[test]
fn table_1_is_in_every_preset() {
    for preset in of_the_first_paper() {
        let Scenario { model, run, .. } = preset.scenario().unwrap();
        let (tracker, noise) = (&model.tracker, &model.noise);
        assert_eq!(tracker.pixels, Some([1024, 1024]));
        assert_eq!(tracker.fov_deg, Some([20.0, 20.0]));
        assert_eq!(
            (tracker.update_rate_hz, tracker.max_stars),
            (Some(10.0), Some(15))
        );
        assert_eq!(noise.temporal_arcsec, Some(7.43));
        assert_eq!(noise.centroid_arcsec, Some(5.06));
        assert_eq!(
            (noise.distortion_arcsec, noise.distortion_order),
            (Some(3.1667), Some(7))
        );
        // 3 sigma: 8.25 and 11.1 arcsec
        assert_eq!(noise.bias_arcsec, Some([2.75, 2.75, 3.7]));
        assert_eq!(run.rate_hz, Some(10.0));
    }
}

/// A line that gives a number names its place in the paper or says that it is assumed, on the line or in
/// the comment that it belongs to; the parts of one slew share the comment above the first.
#[test]
fn every_number_is_printed_or_assumed() {
    for preset in PRESETS {
        let mut comment = String::new();
        let mut after_comment = false;
        for line in preset.text.lines() {
            let code = line.split('#').next().unwrap_or_default().trim();
            let said = line.split_once('#').map_or("", |(_, said)| said);
            if code.is_empty() && !said.is_empty() {
                if !after_comment {
                    comment.clear();
                }
                comment.push_str(said);
                after_comment = true;
            } else if !said.is_empty() {
                comment = said.to_owned();
                after_comment = true;
            } else if code.is_empty() {
                after_comment = false;
            }
            let number = code
                .split_once('=')
                .is_some_and(|(_, value)| value.contains(|c: char| c.is_ascii_digit()));
            if !number || code.starts_with("format") || code.starts_with("title") {
                continue;
            }
            let places = ["4.", "Table 1", "Table 2", "Eq. 1", "text", "above"];
            let place = places.iter().any(|place| comment.contains(place));
            assert!(
                place || comment.to_lowercase().contains("assumption"),
                "{}: `{line}` (comment: {comment})",
                preset.name
            );
        }
    }
}

/// E10: by the printed periods a star crosses a pixel in x in 765 s and one in y in 486.5 s; by the
/// distances it moves 8.78 px in 4 h. The loop's mode (2 arcsec, 0.03 px) and the scale (70.3 to 71.0
/// arcsec a pixel, 1 %) leave 2 % and 0.1 px. The drifts themselves hold the printed numbers at 70.3125
/// arcsec a pixel, to their last digit.
#[test]
fn both_readings_of_the_hold_are_there() {
    for (name, about_x, about_y) in [
        ("iht", 1.0 / 486.5, 1.0 / 765.0),
        ("st2-iht", 1.0 / 486.5, 1.0 / 765.0),
        ("iht-distance", 7.4 / 14_400.0, 4.7 / 14_400.0),
        ("st2-iht-distance", 7.4 / 14_400.0, 4.7 / 14_400.0),
    ] {
        let Motion::Hold(hold) = shortened(name, 1.0).motion else {
            panic!("{name} holds");
        };
        let [x, y, z] = hold.drift_arcsec_s;
        // a turn about +x moves stars to +y, one about +y to -x
        assert!((x - 70.3125 * about_x).abs() < 1e-5, "{name}: {x}");
        assert!((y + 70.3125 * about_y).abs() < 1e-5, "{name}: {y}");
        assert!(z.abs() < 1e-12);
    }
    let periods = simulate_with_truth(&shortened("iht", 7200.0), 0).unwrap();
    let Pixel { x, y } = moved(&periods, 0.0, 7200.0);
    assert!((x * 765.0 / 7200.0 - 1.0).abs() < 0.03, "{x}");
    assert!((y * 486.5 / 7200.0 - 1.0).abs() < 0.03, "{y}");
    let distance = simulate_with_truth(&shortened("iht-distance", 14_400.0), 0).unwrap();
    let Pixel { x, y } = moved(&distance, 0.0, 14_400.0);
    assert!((x - 4.7).abs() < 0.15 && (y - 7.4).abs() < 0.2, "{x} {y}");
    assert!((x.hypot(y) - 8.78).abs() < 0.2);
}

/// Section 4.2: 12 px/s at most, 0.18 px/s between slews (plus a mode of 2 arcsec at 0.036 Hz, which
/// moves at 2 x 0.226 arcsec/s = 0.006 px/s), and both calibrations on their days.
#[test]
fn the_calibration_slews_at_the_printed_rates() {
    for name in ["ict1", "ict2", "st2-ict1", "st2-ict2"] {
        let scenario = shortened(name, 3800.0);
        let day = if name.ends_with('1') {
            "2020-08-17"
        } else {
            "2020-12-05"
        };
        assert!(preset(name).unwrap().text.contains(day));
        let Motion::Slews(slews) = &scenario.motion else {
            panic!("{name} slews");
        };
        assert!((slews.closed_loop.unwrap().frequency_hz - 0.036).abs() < 1e-12);
        let made = simulate_with_truth(&shortened(name, 320.0), 0).unwrap();
        let speed = |t: f64| {
            let Pixel { x, y } = moved(&made, t, t + 0.5);
            2.0 * x.hypot(y)
        };
        assert!(
            (speed(250.0) - 12.0).abs() < 0.25,
            "{name}: {}",
            speed(250.0)
        );
        let hold = 0.5 * (speed(50.0) + speed(150.0));
        assert!((hold - 0.18).abs() < 0.03, "{name}: {hold}");
    }
}

/// Section 4.3: deadbands, cant, DRACO, heaters, migration.
#[test]
fn the_terminal_test_is_as_printed() {
    let scenario = preset("pitt").unwrap().scenario().unwrap();
    assert_eq!(scenario.run.duration_s, Some(2.9 * 3600.0));
    let Motion::PhasePlane(cycle) = &scenario.motion else {
        panic!("a phase plane");
    };
    let off = Vector3::from(cycle.deadband_deg) - Vector3::new(0.11, 0.11, 0.27);
    assert!(off.norm() < 1e-12 && (cycle.cant_deg - 15.0).abs() < 1e-12);
    let [x, y, _] = cycle.drift_arcsec_s;
    let migration_px = x.hypot(y) / 70.3125 * 2.9 * 3600.0;
    assert!((migration_px - 6.5).abs() < 0.01, "{migration_px}");
    let channels = &scenario.housekeeping.as_ref().unwrap().channel;
    let Channel::Thermostat(heater) = &channels[0] else {
        panic!("a heater");
    };
    let cycle_s: f64 = heater.cycle_s().iter().sum();
    assert!((cycle_s - 180.0).abs() < 0.5, "{cycle_s}");
    let bundle = simulate(&shortened("pitt", 30.0)).unwrap();
    let sigma = bundle.reference.unwrap().sigma_arcsec.unwrap()[0];
    for (sigma, (printed, half_digit)) in sigma.iter().zip([(32.0, 0.5), (1.5, 0.05), (120.0, 0.5)])
    {
        assert!((3.0 * sigma - printed).abs() < half_digit, "{sigma}");
    }
}

/// Another tracker, another distortion: the same model, another draw of it.
#[test]
fn the_second_tracker_differs_in_seed_and_field_alone() {
    for name in ["iht", "iht-distance", "ict1", "ict2"] {
        let one = shortened(name, 5.0);
        let two = shortened(&format!("st2-{name}"), 5.0);
        assert_eq!(one.model.noise, two.model.noise);
        assert_eq!(one.model.tracker, two.model.tracker);
        assert_ne!(one.run.seed, two.run.seed);
        assert_eq!(one.reference, two.reference);
        let field = |s: &Scenario| simulate_with_truth(s, 0).unwrap().pbm.distortion().clone();
        assert_ne!(field(&one), field(&two));
    }
}

/// A scenario of kind "hem" makes the attitude alone, with the sigmas of the model; without distortion
/// and bias it needs no stars. The white part is far larger than the process: of n = 2000 samples the
/// deviation is known to `5 sqrt(1 / 2n)` = 8 %. The bias is of arcseconds, the mean of noise and process
/// of a few tenths.
#[test]
fn a_hybrid_scenario_makes_an_attitude() {
    let text = preset("iht").unwrap().text;
    let hem = "[hem.x]\nsigma_hsf_arcsec = 0.1\ntau_hsf_s = 2.0\nsigma_tn_arcsec = 2.0\n\
               [hem.y]\nsigma_hsf_arcsec = 0.1\ntau_hsf_s = 2.0\nsigma_tn_arcsec = 4.0\n\
               [hem.z]\nsigma_hsf_arcsec = 0.1\ntau_hsf_s = 2.0\nsigma_tn_arcsec = 8.0\n";
    let text = text.replacen("kind = \"pbm\"", "kind = \"hem\"", 1) + hem;
    let with_stars = text.replacen(
        "\nrate_hz = 10.0",
        "\ntables = [\"stars\"]\nrate_hz = 10.0",
        1,
    );
    assert!(simulate(&Scenario::parse(&with_stars, "t").unwrap()).is_err());
    let mut scenario = Scenario::parse(&text, "t").unwrap();
    scenario.run.duration_s = Some(200.0);
    let bent = simulate_with_truth(&scenario, 0).unwrap();
    assert!(
        bent.hem
            .as_ref()
            .is_some_and(star_tracker::Hem::needs_stars)
    );
    // centroid error and noise of the stars are in the processes
    assert!(bent.pbm.noise().base_arcsec().abs() < 1e-12);
    assert_eq!(
        bent.pbm.centroid_error(),
        &centroid::CentroidError::default()
    );
    scenario.model.noise.distortion_arcsec = None;
    scenario.model.noise.bias_arcsec = None;
    let plain = simulate_with_truth(&scenario, 0).unwrap();
    assert_eq!(plain.rows.rows(), 0);
    assert!(plain.bundle.stars.is_none() && plain.bundle.catalog.is_none());
    for (made, biased) in [(bent, true), (plain, false)] {
        let table = made.bundle.attitude.unwrap();
        let error: Vec<Vector3<f64>> = table
            .t_s
            .iter()
            .zip(&table.q)
            .map(|(&t, q)| focal_plane::rotation_vector(q, &made.truth.attitude(t).unwrap()))
            .collect();
        let mean = error.iter().sum::<Vector3<f64>>() / 2000.0;
        for (axis, sigma) in [2.0_f64, 4.0, 8.0].into_iter().enumerate() {
            let square: f64 = error.iter().map(|e| (e[axis] - mean[axis]).powi(2)).sum();
            let sigma_found = (square / 2000.0).sqrt() * focal_plane::ARCSEC_PER_RAD;
            assert!(
                (sigma_found / sigma.hypot(0.1) - 1.0).abs() < 0.08,
                "{sigma_found}"
            );
        }
        assert_eq!(
            mean.norm() * focal_plane::ARCSEC_PER_RAD > 1.0,
            biased,
            "{mean}"
        );
    }
}
