//! Causes that no effect of the catalogue has: what is left is told, and no effect is named. Beside each,
//! the effect that it could be taken for: that one is named.
#![expect(clippy::unwrap_used, reason = "helpers of tests")]

use closed_loop::close;
use focal_plane::StarFrames;
use scenarios::{Scenario, simulate};
use telemetry::report::{ConsideredEffect, Report, Verdict};

/// Stars drift over three pixels.
const DRIFT: &str = "kind = \"hold\"\ndrift_arcsec_s = [0.35, -0.27, 0.02]";

/// A swing of two arcsec in ten minutes.
const HOLD: &str = "kind = \"slews\"\nstart = { ra_deg = 83.0, dec_deg = 0.0 }\n\
    [[motion.slew]]\naxis = [0.6, 0.7, 0.4]\nangle_deg = 0.0006\nduration_s = 300.0\n\
    [[motion.slew]]\naxis = [0.6, 0.7, 0.4]\nangle_deg = -0.0006\nduration_s = 300.0\n";

/// To and fro, fast and four times as slowly.
const SLEWS: &str = "kind = \"slews\"\nstart = { ra_deg = 83.0, dec_deg = 0.0 }\nrepeat = 3\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = 1.6\nduration_s = 50.0\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = -1.6\nduration_s = 50.0\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = 0.4\nduration_s = 50.0\n\
    [[motion.slew]]\naxis = [0.0, 1.0, 0.0]\nangle_deg = -0.4\nduration_s = 50.0\n";

/// A reference without error.
fn scenario(motion: &str) -> Scenario {
    let text = r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 14
[noise]
temporal_arcsec = 2.0
[motion]
MOTION
[sky]
kind = "generated"
[reference]
[run]
duration_s = 600.0
rate_hz = 2.0
tables = ["stars", "catalog"]
"#;
    Scenario::parse(&text.replace("MOTION", motion), "unknown.toml").unwrap()
}

/// A number of mean 0 and variance 1 from its place: the sum of twelve uniform ones.
fn noise(place: usize) -> f64 {
    let mut state = (place as u64).wrapping_mul(0x9E37_79B9_7F4A_7C15) ^ 0x1234_5678;
    let mut sum = -6.0;
    for _ in 0..12 {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        sum += (state >> 11) as f64 / (1_u64 << 53) as f64;
    }
    sum
}

/// The report on a bundle whose stars are shifted by `shift` (row, frame: x and y in arcsec).
fn report_on(shift: impl Fn(&StarFrames, usize, usize) -> [f64; 2]) -> Report {
    report_along(DRIFT, shift)
}

fn report_along(motion: &str, shift: impl Fn(&StarFrames, usize, usize) -> [f64; 2]) -> Report {
    let scenario = scenario(motion);
    let mut bundle = simulate(&scenario).unwrap();
    let scale = bundle.camera.clone().unwrap().arcsec_per_px();
    let stars = bundle.stars.as_mut().unwrap();
    let clean = stars.clone();
    for k in 0..clean.frames() {
        for row in clean.rows_of(k) {
            let [dx, dy] = shift(&clean, row, k);
            stars.x_px[row] += dx / scale[0];
            stars.y_px[row] += dy / scale[1];
        }
    }
    let model = scenario.model_without_effects();
    close(&model, &bundle, &|_| ()).unwrap().report
}

fn named(report: &Report) -> Vec<&str> {
    report.effects.iter().map(|e| e.id.as_str()).collect()
}

fn left(report: &Report) -> Vec<&str> {
    let all = report.unattributed.depends_on.iter();
    all.map(|d| d.variable.as_str()).collect()
}

/// The S-curve of a spot of `size` arcsec.
fn s_curve(stars: &StarFrames, row: usize, size: f64) -> [f64; 2] {
    let turn = std::f64::consts::TAU;
    [stars.x_px[row], stars.y_px[row]].map(|p| size * (turn * p).sin())
}

/// Where a star goes within four frames, px.
fn way(stars: &StarFrames, row: usize, k: usize) -> [f64; 2] {
    let place = |k: usize| {
        let same = |&r: &usize| stars.star_id[r] == stars.star_id[row];
        let r = stars.rows_of(k).find(same).unwrap_or(row);
        [stars.x_px[r], stars.y_px[r]]
    };
    let last = stars.frames() - 1;
    let ([ax, ay], [bx, by]) = (place(k.saturating_sub(2)), place((k + 2).min(last)));
    [bx - ax, by - ay]
}

/// 0.16 arcsec under 1.4 arcsec of noise an axis in 16 800 rows: 14 sigma, all of it constant.
#[test]
fn a_constant_s_curve_is_a_pixel_phase_error() {
    let report = report_on(|stars, row, _| s_curve(stars, row, 0.16));
    assert_eq!(named(&report), ["pixel_phase_harmonics"]);
    assert_eq!(report.verdict, Verdict::Explained);
}

/// The same that grows from nothing: its mean is seen as well as above, its change at 8 sigma.
#[test]
fn an_s_curve_that_grows_is_none() {
    let report = report_on(|stars, row, k| s_curve(stars, row, 0.32 * k as f64 / 1200.0));
    assert_eq!(named(&report), [""; 0], "{report:?}");
    // it was found, and what speaks against it is told
    let found = |c: &&ConsideredEffect| c.id == "pixel_phase_harmonics" && c.against.is_some();
    let considered: Vec<_> = report.considered.iter().filter(found).collect();
    let [found] = considered[..] else {
        panic!("{:?}", report.considered)
    };
    // judged without the description that took its place: its mean is 14 sigma, 98 nats
    assert!(
        found.observable && found.p_value.unwrap() < 1e-9,
        "{found:?}"
    );
    assert!(
        (40.0..160.0).contains(&found.delta_loglik.unwrap()),
        "{found:?}"
    );
    assert_eq!(report.verdict, Verdict::Unexplained);
    assert!(
        left(&report)[0].starts_with("pixel_phase_"),
        "{:?}",
        left(&report)
    );
}

/// The same in the middle of the run alone, 0.5 arcsec for three tenths of it: its mean is seen as well as above,
/// and as much before the middle as after.
#[test]
fn an_s_curve_of_the_middle_of_a_run_is_none() {
    let report = report_on(|stars, row, k| {
        let there = (420..780).contains(&k);
        s_curve(stars, row, if there { 0.5 } else { 0.0 })
    });
    assert_eq!(named(&report), [""; 0], "{report:?}");
    assert_eq!(report.verdict, Verdict::Unexplained);
}

/// The scale of a part of a run, while the camera hardly moves: 0.4 arcsec at the edges would yield to an
/// acceleration of 1e-4 arcsec/s^2 by 4000 s^2, what swings once in six minutes.
#[test]
fn what_hardly_moves_yields_to_no_acceleration() {
    let report = report_along(HOLD, |stars, row, k| {
        let there = (420..720).contains(&k);
        [stars.x_px[row], stars.y_px[row]].map(|p| if there { 0.4 * p / 512.0 } else { 0.0 })
    });
    let left = left(&report);
    assert!(left[0].contains("time"), "{left:?}");
    assert!(!left.iter().any(|v| v.contains("acceleration")), "{left:?}");
}

/// One star moves away for half of the time: what it does at all times would be its catalogue position.
#[test]
fn a_star_that_moves_is_no_catalogue_error() {
    let star = |moves: bool| {
        report_on(move |stars, row, k| {
            let acts = stars.slot[row] == 3 && (!moves || k >= 600);
            [if acts { 1.2 } else { 0.0 }, 0.0]
        })
    };
    let (moved, still) = (star(true), star(false));
    assert_eq!(named(&still), ["catalogue_position"]);
    assert_eq!(named(&moved), [""; 0]);
    assert!(
        left(&moved)
            .iter()
            .any(|v| ["time*star", "star"].contains(v)),
        "{:?}",
        left(&moved)
    );
}

/// A walk with a memory of 40 frames of `size` arcsec; all stars take the same, or each its own.
fn walks(own: bool, size: f64) -> Report {
    let mut walk = vec![vec![[0.0; 2]; 1201]; 15];
    let keep = (-1.0_f64 / 40.0).exp();
    let step = size * (1.0 - keep * keep).sqrt();
    for (star, path) in walk.iter_mut().enumerate() {
        for k in 1..path.len() {
            for axis in 0..2 {
                let kick = noise(2 * (1300 * star + k) + axis);
                path[k][axis] = keep * path[k - 1][axis] + step * kick;
            }
        }
    }
    report_on(|stars, row, k| {
        let star = usize::try_from(stars.slot[row]).unwrap();
        walk[if own { star } else { 0 }][k]
    })
}

/// What all stars share is the reference's slow error; what each does by itself is not.
#[test]
fn stars_that_wander_by_themselves_are_no_reference_error() {
    let common = walks(false, 0.5);
    assert_eq!(named(&common), ["reference_error"]);
    let own = walks(true, 0.7);
    assert_eq!(named(&own), [""; 0], "{:?}", own.effects);
    assert!(
        own.unattributed.present && left(&own).contains(&"time*star"),
        "{:?}",
        own.unattributed
    );
}

/// The S-curve of each star has a sign of its own: no phase error of all, and slow as they drift over pixels. It
/// comes back with the phase. Waves of three to six minutes, each star its own, do not. 0.6 arcsec each under 1.4 an
/// axis: a tenth of the variance of each row.
#[test]
fn what_comes_back_with_the_phase_follows_it() {
    let sign = |stars: &StarFrames, row: usize| match stars.star_id[row] % 4 {
        0 => [1.0, 1.0],
        1 => [1.0, -1.0],
        2 => [-1.0, 1.0],
        _ => [-1.0, -1.0],
    };
    let by_phase = report_on(|stars, row, _| {
        let curve = s_curve(stars, row, 0.6);
        let sign = sign(stars, row);
        [curve[0] * sign[0], curve[1] * sign[1]]
    });
    let first = left(&by_phase)[0];
    assert!(first.contains("pixel_phase"), "{:?}", by_phase.unattributed);
    let by_time = report_on(|stars, row, k| {
        let own = (stars.star_id[row] % 7) as f64;
        let turn = std::f64::consts::TAU / (350.0 + 60.0 * own);
        [0.0, 1.3].map(|p| 0.6 * (turn * k as f64 + p + 2.0 * own).sin())
    });
    assert!(
        !left(&by_time)[0].contains("pixel_phase"),
        "{:?}",
        left(&by_time)
    );
    for report in [by_phase, by_time] {
        assert!(report.unattributed.present, "{report:?}");
        assert!(!named(&report).contains(&"pixel_phase_harmonics"));
    }
}

/// A shear that grows: neither place nor time alone.
#[test]
fn what_two_variables_do_together() {
    let report = report_on(|stars, row, k| {
        let column = (stars.x_px[row] / 512.0).clamp(-1.0, 1.0);
        [0.0, 0.35 * column * (k as f64 / 600.0 - 1.0)]
    });
    assert_eq!(named(&report), [""; 0]);
    assert_eq!(left(&report)[0], "x_px*time", "{:?}", left(&report));
}

/// One star of fourteen is misplaced in the catalogue; were it six, something else would move them: a
/// star each way, 1.5 arcsec against 2/sqrt(1200 * 2) of noise.
#[test]
fn a_star_may_be_misplaced_but_not_six() {
    let moved = |count: i64| {
        report_on(|stars, row, _| {
            let id = stars.star_id[row];
            let place = stars.star_id[stars.rows_of(0)]
                .iter()
                .position(|&s| s == id)
                .and_then(|p| i64::try_from(p).ok());
            match place {
                Some(p) if p < count => [0.0, if p % 2 == 0 { 1.5 } else { -1.5 }],
                _ => [0.0; 2],
            }
        })
    };
    assert_eq!(named(&moved(1)), ["catalogue_position"]);
    let many = moved(6);
    assert!(named(&many).is_empty(), "{:?}", named(&many));
    assert_eq!(many.verdict, Verdict::Unexplained);
    assert!(left(&many).contains(&"star"), "{:?}", left(&many));
}

/// Backlash: a shift along the motion that is the same at any speed. A time tag grows with the speed;
/// 0.3 arcsec at two speeds of ratio 4 differ from the best one by 0.3 * 0.51, at 1.4 arcsec an axis
/// in 16 800 rows: 14 sigma.
#[test]
fn the_direction_of_motion_is_no_time_tag() {
    let report = report_along(SLEWS, |stars, row, k| {
        let [x, y] = way(stars, row, k);
        let size = x.hypot(y).max(0.3);
        [0.3 * x / size, 0.3 * y / size]
    });
    assert_eq!(named(&report), [""; 0], "{:?}", report.effects);
    assert_eq!(left(&report)[0], "rate", "{:?}", left(&report));
    let tag = report_along(SLEWS, |stars, row, k| {
        let [x, y] = way(stars, row, k);
        [0.1 * x, 0.1 * y]
    });
    assert_eq!(named(&tag), ["time_tag_offset"]);
}

/// A step of 0.4 arcsec, 18 sigma of 1.4 arcsec an axis in 16 800 rows, beside a scale that follows the speed, which no
/// effect does. The step changes with nothing, no description replaces it, and what is slow is the scale; blocks
/// that scatter by that would hide it, but beside it it is beyond doubt.
#[test]
fn a_step_beside_what_no_effect_is() {
    for size in [0.05, 0.1] {
        let report = report_along(SLEWS, |stars, row, k| {
            let [x, y] = way(stars, row, k);
            let scale = size * x.hypot(y) / 512.0;
            let step = if k > 500 { 0.4 } else { 0.0 };
            [scale * stars.x_px[row] + step, scale * stars.y_px[row]]
        });
        assert_eq!(
            named(&report),
            ["step_misalignment"],
            "{size}: {:?}",
            left(&report)
        );
        assert!(
            left(&report)[0].contains("rate"),
            "{size}: {:?}",
            left(&report)
        );
        let p = report.effects[0].p_value;
        assert!(p < 0.01, "{size}: p = {p}");
    }
}

/// A clock off by 1 ms at up to 115 arcsec/s, ten sigma of it, beside a shear that grows with the rate: the terms that
/// describe the shear hold more than the clock moves, and would take its place if what it leaves were not
/// described, too.
#[test]
fn a_time_tag_beside_what_no_effect_is() {
    let report = report_along(SLEWS, |stars, row, k| {
        let [x, y] = way(stars, row, k);
        let shear = 0.08 * x.hypot(y) / 512.0;
        // four frames are 2 s, a pixel 70 arcsec
        let late = |way_px: f64| 70.0 / 2.0 * way_px * 1e-3;
        [shear * stars.y_px[row] + late(x), late(y)]
    });
    assert_eq!(named(&report), ["time_tag_offset"], "{:?}", left(&report));
    assert!(left(&report)[0].contains("rate"), "{:?}", left(&report));
    let late = &report.effects[0].parameters["offset_s"];
    let off = late.value.abs() - 1e-3;
    assert!(off.abs() < 4.0 * late.sigma.unwrap(), "{late:?}");
}

/// A star misplaced by 1.5 arcsec, 30 sigma of its 1200 rows, beside the same scale: the terms that describe that gain
/// more than the star, and say nothing of it.
#[test]
fn a_misplaced_star_beside_what_no_effect_is() {
    let report = report_along(SLEWS, |stars, row, k| {
        let [x, y] = way(stars, row, k);
        let scale = 0.2 * x.hypot(y) / 512.0;
        let first = stars.star_id[stars.rows_of(0).start];
        let off = if stars.star_id[row] == first {
            1.5
        } else {
            0.0
        };
        [scale * stars.x_px[row], scale * stars.y_px[row] + off]
    });
    let named = named(&report);
    assert_eq!(named, ["catalogue_position"], "{:?}", left(&report));
    assert!(left(&report)[0].contains("rate"), "{:?}", left(&report));
}

/// One star swings by 0.8 arcsec under 1.4 of noise an axis: sqrt(1200 / 2) * 0.8 / 1.4 = 14 sigma, at 0.021 3 Hz
/// with a grid of half of 1/600 s.
#[test]
fn a_line_of_one_star() {
    let report = report_on(|stars, row, k| {
        let swing = (std::f64::consts::TAU * 0.021_3 * 0.5 * k as f64).sin();
        [
            if stars.slot[row] == 5 {
                0.8 * swing
            } else {
                0.0
            },
            0.0,
        ]
    });
    assert_eq!(named(&report), [""; 0]);
    assert_eq!(left(&report)[0], "time*star");
    let lines = &report.unattributed.lines_hz;
    assert!(
        lines.iter().any(|f| (f - 0.021_3).abs() < 0.5 / 600.0),
        "{lines:?}"
    );
}

/// From 370 s on every star stands 0.5 arcsec off in a direction of its own: 12 sigma each before and
/// after, 28 numbers. The same under a wander of the stars is no step.
#[test]
fn every_star_steps_by_its_own() {
    let offset = |slot: i32| {
        let way = 2.4 * f64::from(slot);
        [0.5 * way.cos(), 0.5 * way.sin()]
    };
    let report = report_on(|stars, row, k| {
        if k >= 740 {
            offset(stars.slot[row])
        } else {
            [0.0; 2]
        }
    });
    assert_eq!(report.verdict, Verdict::Unexplained, "{:?}", report.effects);
    let jumps = &report.unattributed.jumps_s;
    // where the likelihood falls by 5 nats: 0.5 arcsec under 1.4 in 28 numbers a frame gain 1.8 a frame
    assert!(jumps.iter().any(|t| (t - 369.75).abs() < 3.0), "{jumps:?}");
    assert!(
        left(&report)
            .iter()
            .any(|v| ["time*star", "star"].contains(v)),
        "{:?}",
        left(&report)
    );
    let wander = walks(true, 0.7);
    assert!(wander.unattributed.jumps_s.is_empty());
}

/// Noise that grows by a half in ten minutes: 16 800 squares tell its slope at
/// sqrt(16 800) * 0.8 / 3.5 / 2 > 10 sigma. Noise that is larger throughout follows nothing.
#[test]
fn the_noise_level_follows_time() {
    let noisy = |grows: bool| {
        report_on(move |_, row, k| {
            let u = if grows { k as f64 / 1200.0 } else { 0.5 };
            [0, 1].map(|axis| 1.6 * u * noise(2 * row + axis))
        })
    };
    let (grows, same) = (noisy(true), noisy(false));
    assert_eq!(named(&grows), [""; 0]);
    let told = &grows.unattributed.noise_depends_on;
    assert_eq!(told[0].variable, "time", "{told:?}");
    assert_eq!(left(&grows)[0], "time");
    assert_eq!(grows.verdict, Verdict::Unexplained);
    assert_eq!(same.verdict, Verdict::Consistent, "{:?}", same.unattributed);
    assert!(same.unattributed.noise_depends_on.is_empty());
}

/// A channel of the read-out that is noisier by 1.2 arcsec beside 1.4, through which stars pass one after another: ln 1.73 of their
/// variance, where 1200 rows tell it to 0.03. It is the slot's, and no star's.
#[test]
fn the_noise_level_follows_a_slot() {
    let scan = "kind = \"hold\"\ndrift_arcsec_s = [130.0, 90.0, 20.0]";
    let noisy = |size: f64| {
        report_along(scan, move |stars, row, _| {
            let of_slot = f64::from(u8::from(stars.slot[row] == 3));
            [0, 1].map(|axis| size * of_slot * noise(2 * row + axis))
        })
    };
    let told = noisy(1.2).unattributed.noise_depends_on;
    assert_eq!(told[0].variable, "slot", "{told:?}");
    let same = noisy(0.0).unattributed.noise_depends_on;
    assert!(same.is_empty(), "{same:?}");
}
