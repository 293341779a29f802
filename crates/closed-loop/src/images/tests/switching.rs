//! Pixels that switch, on made-up windows.
//!
//! Not physics: tests.

use super::*;
use crate::images::switching::{Scores, visits};

/// One pixel in four has 40 more half of the time, drawn anew every 40 frames.
fn telegraph(k: usize, centre: [f64; 2]) -> f64 {
    let on = uniform(centre, 2 + (k / 40) as u64) < 0.5;
    if on && switches(centre) { 40.0 } else { 0.0 }
}

fn switches(centre: [f64; 2]) -> bool {
    uniform(centre, 1) < 0.25
}

/// Slow motion of the first star, px.
fn slow(k: usize, star: usize) -> f64 {
    if star == 0 {
        0.03 * (k as f64 / 25.0).sin()
    } else {
        0.0
    }
}

#[test]
fn pixels_that_switch_are_followed() {
    for seed in 0..4 {
        let scene = Scenario {
            dark: &warm,
            frames: 800,
            seed,
            ..scenario()
        };
        let still = scene.make();
        let made = Scenario {
            switching: &telegraph,
            ..scene
        }
        .make();
        let formed_still = formed(&still);
        let f = formed(&made);
        println!(
            "{seed} still {} followed {} moving {}",
            rms(
                &still,
                &out_of_fold(&still, &formed_still.with_map.fitted),
                &every
            ),
            formed_still.with_map.switching,
            f.with_map.switching
        );
        println!(
            "  fitted {} followed {}",
            rms(&made, &out_of_fold(&made, &f.with_map.fitted), &every),
            rms(&made, &out_of_fold(&made, &f.with_map.followed), &every)
        );
        let drift = Scenario {
            dark: &warm,
            frames: 800,
            seed,
            switching: &telegraph,
            wander: &slow,
            ..scenario()
        }
        .make();
        let d = formed(&drift);
        for (n, v) in [
            ("fitted", &d.with_map.fitted),
            ("followed", &d.with_map.followed),
        ] {
            let at = out_of_fold(&drift, v);
            let (mut a, mut b) = (0.0, 0.0);
            for (r, &x) in at[0].iter().enumerate() {
                if drift.data.star[r] == 0 {
                    let s = slow(r / 4, 0);
                    a += s * (x - drift.truth[0][r]);
                    b += s * s;
                }
            }
            println!("  {n} slope {}  rms {}", a / b, rms(&drift, &at, &every));
        }
    }
}

/// Two stars and what was learned of them.
fn learned(made: &Made) -> (Sample, Learned, Vec<Option<Fitted>>) {
    let frames = entries(&made.data, &made.windows);
    let sample = Sample::collect(FIELD.len(), made.windows.size, &[], &frames).unwrap();
    let grid = Grid::new(sample.reach_px() + MARGIN_PX, KNOTS_PX);
    let taken: Vec<usize> = (0..made.data.frames.frames()).collect();
    let one = learn::learn(&sample, &taken, grid, 512.0, true, false);
    let mut pixels = Pixels::default();
    let fits = (0..sample.windows())
        .map(|w| one.fitted(&sample, w, &mut pixels))
        .collect();
    (sample, one, fits)
}

/// Light of a star that has moved, slowly or from frame to frame, or is brighter, leaves no score in any pixel.
#[test]
fn what_moves_a_star_is_not_followed() {
    let made = Scenario {
        frames: 120,
        ..scenario()
    }
    .make();
    let (mut sample, one, fits) = learned(&made);
    let list = visits(&sample);
    let before = Scores::new(&sample, &one, &fits, &list, |_| true);
    for w in 0..sample.windows() {
        let jitter = 0.01 * (w as f64 * 1.7).sin();
        let moved = [20.0, 0.0, 0.02 * (w as f64 / 90.0).sin(), jitter];
        for i in sample.cells_of(w) {
            let column = before.column[i];
            sample.z[i] += (0..4).map(|k| moved[k] * column[k]).sum::<f64>();
        }
    }
    let after = Scores::new(&sample, &one, &fits, &list, |_| true);
    let (mut change, mut naive) = (0.0_f64, 0.0_f64);
    for (i, (a, b)) in before.score.iter().zip(&after.score).enumerate() {
        let sigma = before.weight[i].sqrt();
        change = change.max((a - b).abs() / sigma);
        naive = naive.max(sigma * before.column[i][2].abs() * 0.02);
    }
    println!("{change} {naive}");
    // rounding; by itself the motion would be several sigmas of a pixel
    assert!(change < 1e-9, "{change}");
    assert!(naive > 3.0, "{naive}");
}
