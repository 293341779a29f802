use std::f64::consts::{PI, TAU};

use block_regression::Folds;
use rand_core::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use telemetry::report::{Dependence, Unattributed};

use super::{Field, Pattern, climb, likeliest};

const STARS: usize = 12;
const FRAMES: usize = 400;
const SIDE: f64 = 256.0;

/// Stars on paths of `path_px`, each in a direction of its own as a roll has them, white noise of `sigma` beside noise of
/// 20 frames' memory, a constant of each star, and a `signal` on x.
fn field(seed: u64, path_px: f64, noise: [f64; 2], signal: &dyn Fn(f64, f64) -> f64) -> Field {
    field_of(seed, path_px, noise, &|x, y| [signal(x, y), 0.0])
}

/// The same with a signal on both axes.
fn field_of(
    seed: u64,
    path_px: f64,
    [sigma, slow]: [f64; 2],
    signal: &dyn Fn(f64, f64) -> [f64; 2],
) -> Field {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut at: [Vec<f64>; 2] = Default::default();
    let mut residual: [Vec<f64>; 2] = Default::default();
    let mut frame = Vec::new();
    let mut of_star = Vec::new();
    let decay = (-1.0_f64 / 20.0).exp();
    for star in 0..STARS {
        let (sin, cos) = (2.4 * star as f64).sin_cos();
        let start: [f64; 2] =
            std::array::from_fn(|_| (rng.next_u64() as f64 / u64::MAX as f64 - 0.5) * SIDE);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let constant = [3.0 * normal(), 3.0 * normal()];
        let mut wander = [slow * normal(), slow * normal()];
        let first = frame.len();
        for k in 0..FRAMES {
            let along = path_px * k as f64 / FRAMES as f64;
            let (x, y) = (start[0] + along * cos, start[1] + along * sin);
            at[0].push(x);
            at[1].push(y);
            frame.push(u32::try_from(k).unwrap());
            for axis in 0..2 {
                wander[axis] =
                    decay * wander[axis] + slow * (1.0 - decay * decay).sqrt() * normal();
                let acts = signal(x, y)[axis];
                residual[axis].push(constant[axis] + wander[axis] + sigma * normal() + acts);
            }
        }
        of_star.push((first..frame.len()).collect());
    }
    Field::new(
        [&at[0], &at[1]],
        [&residual[0], &residual[1]],
        &frame,
        &of_star,
        &vec![1.0; frame.len()],
    )
}

fn search(field: &Field) -> Option<Pattern> {
    let found = field
        .clone()
        .patterns(&|| field.clone(), &Folds::cut(FRAMES), Some(7));
    likeliest(found)
}

fn wave(k: [f64; 2], size: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| size * (TAU * (k[0] * x + k[1] * y) + 0.7).sin()
}

/// A transform finds nothing for a chance that no few rows have.
#[test]
fn few_rows_are_not_transformed() {
    let noise = field(1, 60.0, [1.0, 0.0], &|_, _| 0.0);
    assert!(noise.has_clusters(&Folds::cut(FRAMES)));
    let few = Field::new(
        [&noise.x_px[..7], &noise.y_px[..7]],
        noise.residual.each_ref().map(|r| &r[..7]),
        &noise.frame[..7],
        &[(0..7).collect()],
        &[1.0; 7],
    );
    assert!(!few.has_clusters(&Folds::cut(FRAMES)));
}

/// The transform along the radius has a size of its own, whatever the places.
#[test]
fn stars_far_off_the_detector_are_searched_like_others() {
    let mut far = field(1, 60.0, [1.0, 0.0], &|_, _| 0.0);
    far.x_px[..FRAMES].iter_mut().for_each(|x| *x += 1e12);
    assert_eq!(search(&far), None);
}

/// The top of a wave over 200 px, sinc^2 on both axes, from up to 0.7 cycles off: outside of the first three points,
/// too. A parabola's top is off by (pi step)^2 / 5 of the way at most, 0.12 of it at a quarter of a cycle and a
/// sixteenth of that each round: 0.7 x 0.12 x 0.008 x 0.0005 cycles, and what rounding makes of a flat top, 1e-8.
#[test]
fn a_top_is_climbed_to_the_middle() {
    let top = [0.137, -0.291];
    let sinc = |v: f64| {
        if v.abs() < 1e-9 {
            1.0
        } else {
            (PI * v).sin() / (PI * v)
        }
    };
    let power = |k: [f64; 2]| {
        let off = [0, 1].map(|a| sinc(200.0 * (k[a] - top[a])).powi(2));
        off[0] * off[1]
    };
    for off in [[0.2, -0.1], [0.7, 0.4], [0.0, -0.6]] {
        let start = [0, 1].map(|a| top[a] + off[a] / 200.0);
        let (at, k) = climb(&power, (power(start), start), [0.25 / 200.0; 2], 3);
        for axis in 0..2 {
            let left: f64 = 200.0 * (k[axis] - top[axis]);
            assert!(left.abs() < 1e-6, "{left} {off:?}");
        }
        assert!((at - 1.0).abs() < 1e-9);
    }
}

/// A fringe of 1.5 arcsec has sqrt(4800 / 2) * 1.5 / 7.35 = 10 sigma in 4800 rows. Its wave vector is known
/// to 1 / (2 pi 10 * spread), where the positions spread by some 60 to 80 px: 2.4e-4 cycles/px, a
/// sixteenth of a step 1/256. The gate is 5 of these.
#[test]
fn a_fringe_is_found_with_its_wave_vector() {
    for (seed, k) in [
        (1, [1.0 / 7.3, 0.7 / 7.3]),
        (2, [-0.211_7, 0.313_3]),
        (3, [0.437_3, 0.091_9]),
    ] {
        let found = search(&field(seed, 60.0, [7.35, 0.0], &wave(k, 1.5))).expect("beyond doubt");
        for (axis, truth) in k.iter().enumerate() {
            assert!(
                (found.wave[axis] - truth).abs() < 5.0 * 2.4e-4,
                "{k:?}: {found:?}"
            );
        }
        assert_eq!(found.variable(), "x_px*y_px");
        // 1.5^2 / 2 of 1.5^2 / 2 + 2 * 7.35^2, less 4 amplitudes of 9600 numbers: 0.0103
        assert!(
            (0.005..0.017).contains(&found.explained),
            "{k:?}: {found:?}"
        );
    }
}

/// Four of twelve stars are four times as quiet. With weights the wave has 1600 * 0.9^2 / 2 / 2.5^2 = 104 of T^2 in
/// them and 13 in the rest; without, 4800 * 0.9^2 / 2 over a mean variance of 69: 28, where 2 ln(trials / 0.01) is 36.
#[test]
fn quiet_stars_count_for_more() {
    let k = [1.0 / 7.3, 0.7 / 7.3];
    let signal = wave(k, 0.9);
    let loud = field(4, 60.0, [10.0, 0.0], &signal);
    let quiet = field(4, 60.0, [2.5, 0.0], &signal);
    let mixed = |weigh: bool| {
        let mut mixed = loud.clone();
        for (star, rows) in loud.stars.iter().enumerate() {
            let (from, weight) = if star < 4 {
                (&quiet, 4.0)
            } else {
                (&loud, 1.0)
            };
            let weight = if weigh { weight } else { 1.0 };
            for row in rows.clone() {
                for axis in 0..2 {
                    mixed.residual[axis][row] = weight * from.residual[axis][row];
                }
            }
            mixed.weight[star] = weight;
        }
        search(&mixed)
    };
    let found = mixed(true).expect("beyond doubt");
    assert!(
        (0..2).all(|a| (found.wave[a] - k[a]).abs() < 1e-3),
        "{found:?}"
    );
    assert_eq!(mixed(false), None);
}

/// One null in 400 may raise an alarm: of 20, one or more one time in 20, none with these seeds.
/// `BORESIGHT_SEEDS` takes more; then 5 sigma of a Poisson count are allowed.
#[test]
fn noise_holds_no_pattern() {
    let (seeds, most) = crate::many_seeds(20, 1, 400);
    for (path, slow) in [(60.0, 0.0), (60.0, 3.0), (2.0, 0.0), (0.1, 2.0)] {
        let alarms = (0..seeds)
            .filter(|&seed| search(&field(100 + seed, path, [5.0, slow], &|_, _| 0.0)).is_some())
            .count();
        println!("paths of {path} px, slow {slow}: {alarms} of {seeds}");
        assert!(alarms <= most, "paths of {path} px: {alarms}");
    }
}

/// However strong a wave of whole pixels along one axis is, pixel phase has terms for it; a diagonal one of
/// whole pixels is a function of both phases.
#[test]
fn whole_pixels_are_left_to_pixel_phase() {
    let axis = |x: f64, _: f64| 4.0 * (TAU * x).sin() + 2.0 * (2.0 * TAU * x).cos();
    assert_eq!(search(&field(7, 60.0, [5.0, 0.0], &axis)), None);
    let both = search(&field(8, 60.0, [5.0, 0.0], &wave([1.0, -1.0], 4.0))).expect("beyond doubt");
    assert_eq!(both.variable(), "pixel_phase_x*pixel_phase_y");
}

/// Zones of 25 px outwards, 2.2 arcsec under 7.35: 4800 rows of amplitude 2.2/sqrt 2 are 15 sigma. Across them there is
/// nothing, and a wave across the detector takes hardly a tenth of their squares.
#[test]
fn rings_are_found_by_their_radius() {
    for seed in 1..5 {
        let zones = |x: f64, y: f64| {
            let radius = x.hypot(y);
            let out = 2.2 * (TAU * radius / 25.0 + 0.4).sin() / radius.max(1.0);
            [out * x, out * y]
        };
        let found = search(&field_of(seed, 60.0, [7.35, 0.0], &zones)).expect("beyond doubt");
        assert!(found.ring, "{found:?}");
        assert!((found.wave[0] - 0.04).abs() < 1e-3, "{found:?}");
        assert_eq!(found.variable(), "x_px*y_px");
    }
}

/// A wave along one axis is named after that axis.
#[test]
fn waves_are_named_after_their_direction() {
    for (k, name) in [([0.137, 0.0], "x_px"), ([0.0, 0.137], "y_px")] {
        let found = search(&field(9, 60.0, [5.0, 0.0], &wave(k, 2.0))).expect("beyond doubt");
        assert_eq!(found.variable(), name, "{found:?}");
    }
}

#[test]
fn the_list_stays_sorted_and_keeps_what_explains_more() {
    let entry = |variable: &str, variance_explained| Dependence {
        variable: variable.to_owned(),
        variance_explained,
        p_value: 1e-5,
    };
    let mut unattributed = Unattributed {
        present: false,
        variance_fraction: Some(0.01),
        depends_on: vec![entry("time", 0.02), entry("x_px", 0.015), entry("mag", 0.0)],
        ..Unattributed::default()
    };
    let pattern = |explained| Pattern {
        power: 100.0,
        wave: [0.1, 0.0],
        ring: false,
        trials: 1.0,
        p_value: 1e-9,
        explained,
        extent: [SIDE; 2],
    };
    let told = |u: &Unattributed| -> Vec<(String, f64)> {
        u.depends_on
            .iter()
            .map(|d| (d.variable.clone(), d.variance_explained))
            .collect()
    };
    let before = told(&unattributed);
    pattern(0.01).tell(&mut unattributed, 0.5);
    assert!(unattributed.present);
    assert_eq!(told(&unattributed), before);
    assert_eq!(unattributed.variance_fraction, Some(0.01));
    pattern(0.03).tell(&mut unattributed, 0.5);
    let after = told(&unattributed);
    assert_eq!(after[0], ("x_px".to_owned(), 0.03));
    assert_eq!(after.len(), 3);
    assert_eq!(unattributed.variance_fraction, Some(0.015));
}

/// The series leave out terms of 5e-13 and less at a right angle.
#[test]
fn waves_are_sines_and_cosines() {
    for i in -400..400 {
        let cycles = 0.013 * f64::from(i);
        let (sin, cos) = (TAU * cycles).sin_cos();
        let [c, s] = super::wave(cycles);
        assert!(
            (c - cos).abs() < 1e-11 && (s - sin).abs() < 1e-11,
            "{cycles}"
        );
    }
}

/// Stars whose spots err with the pixel phase, each in a way of its own, have no pattern in common: a wave near one cycle
/// per pixel fits what twelve stars do by chance. A fringe beside it is found as before.
#[test]
fn spots_of_their_own_are_no_pattern() {
    let phase = |x: f64, y: f64| {
        // paths start at least a few pixels apart
        let star = ((x / 64.0).floor() * 5.0 + (y / 64.0).floor() * 3.0).sin();
        8.0 * star * (TAU * (x + 0.3 * star)).sin()
    };
    let fringe = wave([0.31, 0.17], 2.0);
    let own = |field: Field| Field {
        own_spots: true,
        ..field
    };
    let mut pooled = 0;
    for seed in 0..5 {
        let errs = field(seed, 60.0, [5.0, 0.0], &phase);
        pooled += usize::from(search(&errs).is_some());
        assert_eq!(search(&own(errs)), None, "seed {seed}");
        let both = own(field(seed, 60.0, [5.0, 0.0], &|x, y| {
            phase(x, y) + fringe(x, y)
        }));
        let found = search(&both).expect("beyond doubt");
        assert_eq!(found.variable(), "x_px*y_px");
    }
    assert!(pooled > 0);
}
