use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;

use super::{Leftover, Series, Track, WORTH_A_SEARCH};

fn describe(tracks: &[Track]) -> Leftover {
    Series::of(tracks).describe()
}

/// Three series of 2 Hz: white noise of 1 arcsec, a Gauss-Markov part, and `signal` on the second.
fn tracks(seed: u64, points: usize, slow: f64, signal: &dyn Fn(f64) -> f64) -> Vec<Track> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    (0..3)
        .map(|axis| {
            let decay = (-0.5_f64 / 20.0).exp();
            let mut wander = slow * normal();
            let t_s: Vec<f64> = (0..points).map(|k| 0.5 * k as f64).collect();
            let value = t_s
                .iter()
                .map(|t| {
                    wander = decay * wander + slow * (1.0 - decay * decay).sqrt() * normal();
                    wander + normal() + if axis == 1 { signal(*t) } else { 0.0 }
                })
                .collect();
            Track {
                changes: None,
                turns: true,
                weight: vec![1.0; points],
                t_s,
                value,
            }
        })
        .collect()
}

/// White noise of 1 arcsec, and `signal` on all axes.
fn on_all_axes(seed: u64, signal: &dyn Fn(f64) -> f64) -> Vec<Track> {
    let mut all = tracks(seed, 500, 0.0, &|_| 0.0);
    for track in &mut all {
        for (v, t) in track.value.iter_mut().zip(&track.t_s) {
            *v += signal(*t);
        }
    }
    all
}

/// A step of a third of the noise on all axes.
fn all_step(seed: u64) -> Vec<Track> {
    on_all_axes(seed, &|t| if t > 110.2 { 0.34 } else { 0.0 })
}

fn shows_the_step(all: &[Track]) -> bool {
    let found = Series::of(all).shared_jump();
    found.is_some_and(|f| (f.at_s - 110.25).abs() < 30.0)
}

fn alarms(seeds: std::ops::Range<u64>, slow: f64) -> [usize; 2] {
    let mut count = [0; 2];
    for seed in seeds {
        let found = describe(&tracks(seed, 500, slow, &|_| 0.0));
        count[0] += usize::from(!found.lines_hz.is_empty());
        count[1] += usize::from(!found.jumps_s.is_empty());
    }
    count
}

/// One bundle in 400 may show a line or a jump: of 40 there are 0.1 on average, 3 or more one time in 6500.
/// `BORESIGHT_SEEDS` takes more; then 5 sigma of a Poisson count are allowed.
#[test]
fn noise_holds_neither_lines_nor_jumps() {
    let (seeds, most) = crate::many_seeds(40, 2, 400);
    for slow in [0.0, 0.3, 1.0] {
        let found = alarms(0..seeds, slow);
        println!("slow {slow}: lines, jumps of {seeds}: {found:?}");
        assert!(found[0] + found[1] <= most, "slow {slow}: {found:?}");
    }
}

/// The bound of a frequency is sqrt(6 / N) / (pi T) sigma/A: for 500 samples of 0.5 s and A = 0.8 it is
/// 1.7e-4 Hz, a twenty-third of a bin of 4e-3 Hz. The gate is 5 of those; wander adds a little.
#[test]
fn lines_are_refined_far_below_a_bin() {
    let bound = (6.0_f64 / 500.0).sqrt() / (std::f64::consts::PI * 250.0) / 0.8;
    for (seed, f) in [(1, 0.123_4), (2, 0.301_7), (3, 0.877_1)] {
        for slow in [0.0, 0.7] {
            let line = |t: f64| 0.8 * (std::f64::consts::TAU * f * t + 0.4).cos();
            let found = describe(&tracks(seed, 500, slow, &line));
            assert_eq!(found.lines_hz.len(), 1, "{f}, {slow}: {found:?}");
            assert!(
                (found.lines_hz[0] - f).abs() < 5.0 * bound,
                "{f}: {found:?}"
            );
            assert!(found.jumps_s.is_empty(), "{f}, {slow}: {found:?}");
        }
    }
}

/// Two lines 3 bins apart are two.
#[test]
fn two_lines_are_told_apart() {
    let lines = |t: f64| {
        let phase = std::f64::consts::TAU * t;
        (0.2 * phase).cos() + (0.212 * phase + 1.0).cos()
    };
    let found = describe(&tracks(5, 500, 0.0, &lines));
    assert_eq!(found.lines_hz.len(), 2, "{found:?}");
    assert!((found.lines_hz[0] - 0.2).abs() < 1.5e-3, "{found:?}");
    assert!((found.lines_hz[1] - 0.212).abs() < 1.5e-3, "{found:?}");
}

/// A step of two sigma is placed within ten points: the chance that noise moves it by k points falls as
/// exp(-k step^2 / 8 sigma^2), e^-5 here.
#[test]
fn jumps_are_placed() {
    for (slow, size) in [(0.0, 2.0), (0.5, 3.0)] {
        let found = describe(&tracks(7, 500, slow, &|t| {
            if t > 90.2 { size } else { 0.0 }
        }));
        assert_eq!(found.jumps_s.len(), 1, "slow {slow}: {found:?}");
        assert!(
            (found.jumps_s[0] - 90.25).abs() < 5.0,
            "slow {slow}: {found:?}"
        );
        assert!(found.lines_hz.is_empty(), "slow {slow}: {found:?}");
    }
}

/// A hole in the series and a spike are neither.
#[test]
fn holes_and_spikes_are_neither() {
    let mut all = tracks(11, 500, 0.0, &|_| 0.0);
    for track in &mut all {
        for series in [&mut track.t_s, &mut track.value, &mut track.weight] {
            series.drain(200..260);
        }
        track.value[100] = 300.0;
        track.weight[300] = 0.0;
        track.value[300] = f64::NAN;
    }
    assert_eq!(describe(&all), Leftover::default());
}

/// A line that no axis shows by itself: -ln P is 1 + A^2 N / 4 = 7.0 +- 3.6 on each, where one of 988
/// frequencies needs 13.3 (one in 20: 3 of 20 runs on some axis); together 21 +- 6 where 14 will do
/// (17 of 20). Gates of 3.5 sigma.
#[test]
fn axes_together_show_what_none_does_alone() {
    let (mut shared, mut alone) = (0, 0);
    for seed in 0..20 {
        let line = |t: f64| 0.22 * (std::f64::consts::TAU * 0.231 * t).cos();
        let all = on_all_axes(seed, &line);
        let found = Series::of(&all).shared_line(WORTH_A_SEARCH);
        shared += usize::from(found.is_some_and(|f| (f.frequency_hz - 0.231).abs() < 1e-3));
        alone += usize::from(!describe(&all).lines_hz.is_empty());
    }
    assert!(shared >= 12 && alone <= 8, "{shared} {alone}");
}

/// A line about X alone of A^2 N / 4 = 14 +- 5 nats among 988 frequencies. Held against 90 frequencies around it, and across
/// the boresight as well, it is worth a search in 30 of these 40 runs; by 30 around it and all three axes alone it was in 27.
#[test]
fn a_line_about_one_axis_is_worth_a_search() {
    let found = (0..40).filter(|&seed| {
        let mut all = tracks(seed, 500, 0.0, &|_| 0.0);
        let line = |t: f64| 0.334 * (std::f64::consts::TAU * 0.231 * t).cos();
        let (t_s, value) = (all[0].t_s.clone(), &mut all[0].value);
        value.iter_mut().zip(t_s).for_each(|(v, t)| *v += line(t));
        let found = Series::of(&all).shared_line(WORTH_A_SEARCH);
        found.is_some_and(|f| (f.frequency_hz - 0.231).abs() < 1e-3)
    });
    let found = found.count();
    assert!(found >= 28, "{found}");
}

/// The line that is put forward lies at the top of its power, not at a point of the grid, of which there are four in 1/T:
/// of one of 1" about each of three axes the frequency scatters by sqrt(6 / N) / (pi T) = 0.08 points (N = 1500,
/// T = 250 s), where points scatter by 0.29. A gate of 4 sigma over 40 draws.
#[test]
fn a_shared_line_lies_between_points() {
    const DRAWS: u32 = 40;
    let square_points = |draw: u32| {
        let true_hz = 0.231 + 1e-3 * f64::from(draw) / f64::from(DRAWS);
        let line = |t: f64| (std::f64::consts::TAU * true_hz * t).cos();
        let all = on_all_axes(u64::from(draw), &line);
        let found = Series::of(&all).shared_line(WORTH_A_SEARCH).unwrap();
        ((found.frequency_hz - true_hz) / 1e-3).powi(2)
    };
    let square = (0..DRAWS).map(square_points).sum::<f64>() / f64::from(DRAWS);
    let bound = (6.0_f64 / 1500.0).sqrt() / (std::f64::consts::PI * 0.25);
    assert!(square.sqrt() < 1.45 * bound, "{} {bound}", square.sqrt());
}

/// The chance that noise is searched again is 0.1 at most: 4 of 40, and 5 sigma.
#[test]
fn noise_is_seldom_worth_another_search() {
    for slow in [0.0, 1.0] {
        let again = (0..40)
            .filter(|&seed| {
                let all = tracks(seed, 500, slow, &|_| 0.0);
                Series::of(&all).shared_line(WORTH_A_SEARCH).is_some()
            })
            .count();
        assert!(again <= 14, "slow {slow}: {again}");
    }
}

/// Series that are no rotation (growth, shears) are no line of the attitude.
#[test]
fn what_does_not_turn_is_no_shared_line() {
    let line = |t: f64| (std::f64::consts::TAU * 0.231 * t).cos();
    let mut all = tracks(3, 500, 0.0, &line);
    assert!(Series::of(&all).shared_line(WORTH_A_SEARCH).is_some());
    all.iter_mut().for_each(|t| t.turns = false);
    let series = Series::of(&all);
    assert!(series.shared_line(WORTH_A_SEARCH).is_none());
    assert_eq!(series.describe().lines_hz.len(), 1);
}

/// A step that no axis shows by itself: 9 sigma^2 a axis on average where the best of 490 instants needs 25, and
/// three together 25 / 3 each. It is found within the ten points of `jumps_are_placed`, twice as many for a step
/// of 0.27 sigma as for one of 2 would be far: 60 points of 500.
#[test]
fn axes_together_show_a_step_that_none_does_alone() {
    let (mut shared, mut alone) = (0, 0);
    for seed in 0..20 {
        let all = all_step(seed);
        shared += usize::from(shows_the_step(&all));
        alone += usize::from(!describe(&all).jumps_s.is_empty());
    }
    assert!(shared >= 12 && alone < shared, "{shared} {alone}");
}

/// As with lines, noise is searched again one time in ten at most: 4 of 40, and 5 sigma.
#[test]
fn noise_seldom_holds_a_shared_jump() {
    for slow in [0.0, 1.0] {
        let again = (0..40)
            .filter(|&seed| {
                let all = tracks(seed, 500, slow, &|_| 0.0);
                Series::of(&all).shared_jump().is_some()
            })
            .count();
        assert!(again <= 14, "slow {slow}: {again}");
    }
}

/// Axes whose rows weigh differently have the same times still: what they share is found. The step
/// is that of `axes_together_show_a_step_that_none_does_alone`.
#[test]
fn axes_that_weigh_differently_share_a_step() {
    let shared = (0..20)
        .filter(|&seed| {
            let mut all = all_step(seed);
            for (axis, track) in all.iter_mut().enumerate() {
                for (k, w) in track.weight.iter_mut().enumerate() {
                    *w = 0.1 + 0.3 * axis as f64 + 1e-3 * (k % 7) as f64;
                }
            }
            shows_the_step(&all)
        })
        .count();
    assert!(shared >= 12, "{shared}");
}
