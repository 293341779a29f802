//! Where the light of each star fell, better than its reference says.
//!
//! Pixel phase is that of where the light fell. A reference with noise e of its own puts all stars of a
//! frame off by A e, and the residual holds the same e: a centroid error evaluated there is a wrong one,
//! and a column that falls with the position "explains" the reference's noise. A frame whose attitude is
//! that of its stars is off by their noise. So a row's position is turned by what the frame's stars,
//! the reference and the frames around say of the frame's rotation together,
//!
//! ```text
//! theta = V (sum w^2 A' r / s^2 + p / Q)      V = (sum w^2 A' A / s^2 + 1/S + 1/Q)^-1
//! P     = modelled + A theta,   known to A V A'
//! ```
//!
//! S being the variance of the reference's rotations (none: its noise is infinite), p what the frames
//! around predict, Q how well. The sums are over all stars: what a best prediction errs by has nothing in common
//! with what it was made of, so that a star's residual is nothing that its position could explain. Without the
//! star itself position and residual share -A V A' of the reference's error, which stars at rest, whose phases never
//! change, have for a centroid error.
//!
//! ```text
//! p       quadratic in time through the attitudes around, each as its stars and reference have it: of 2 to 16
//!         on each side the most that agree with all that are fewer within 2 sigma
//! Q       variance of that fit, and what the frames around were themselves predicted worse than this says
//! E c(P)  of a centroid error at a position known to a variance v: the mean over it, see [`centroid`]
//! ```
//!
//! Where the reference's error lasts from frame to frame it is no prior of each frame anew, and would be believed as
//! often: then p and Q are what the stars around say of that error ([`lasting`]), without S.
//!
//! Stars may be too noisy to see that the reference errs. What the attitudes around a frame do not tell of its own is
//! motion or such an error: as much of that as would not show is taken for S. If it was motion, a position is off by
//! what has nothing in common with its residual.
//!
//! Under slow motion the frames around tell most (6 stars at rest: 0.25 px by a frame's stars, 0.07 px with
//! them); under fast motion they know nothing, and Q says so, but of an error that is slow.
//!
//! Source: Henderson 1975 (best linear unbiased prediction); Katkovnik 1999 (intersection of confidence
//! intervals, for the stretch of time).

use focal_plane::{ARCSEC_PER_RAD, AttitudeSeries, rotation_from_vector, rotation_vector};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use spectra::robust::median_step;

use crate::gaps::GAP_STEPS;
use crate::motion::neighbours::{SIDE, of_samples, predicted};
use crate::star::changes;
use crate::star::data::{Light, StarData};
use crate::star::frame_rotation::{Turns, rotation_row};
use crate::star::weights;
use lasting::{Lasting, shows};

mod lasting;

/// Frames on each side that predict one: fewest and most.
const FEWEST: usize = 2;
const MOST: usize = 16;
/// Fits over longer stretches agree with those over shorter ones within this many sigma.
const AGREE: f64 = 2.0;
/// Frames on each side by whose own prediction it is judged.
const JUDGES: usize = 32;
/// A reference that errs by less than this leaves the light where it is modelled, px.
const KNOWN_PX: f64 = 1e-3;

/// Sigmas of what the stars' own noise makes of a reference's variance, by which more would show.
const HIDDEN: f64 = 3.0;

/// A rotation axis by axis, with its variances.
type Known = [(f64, f64); 3];
const NOTHING: Known = [(0.0, f64::INFINITY); 3];

/// Where the light of `data` falls; `residual`: what the best fit leaves, arcsec.
pub(crate) fn of(data: &StarData, residual: [&[f64]; 2]) -> Light {
    let rows = data.t_s.len();
    let mut light = Light::as_modelled(rows);
    let weight = weights::of(data, &changes::of(data));
    let turns = Turns::of(data, residual, &weight);
    let t_s = &data.frames.t_s;
    // information of the reference, none where there is none, and what of its errors lasts
    let (mut reference, lasting) = if data.free_attitude {
        ([0.0; 3], [None; 3])
    } else {
        let known = KNOWN_PX * data.camera.arcsec_per_px()[0];
        let unsteady = unsteady(data);
        let good = |axis: usize| turns.reference[axis].max(unsteady[axis]) < known * known;
        if (0..2).all(good) {
            return light;
        }
        // what chance makes of the stars' noise would put that noise into their positions
        let errs: [bool; 3] = std::array::from_fn(|axis| shows(&turns, axis, 1));
        let lasting: [_; 3] = std::array::from_fn(|axis| Lasting::of(&turns, t_s, axis));
        // but what the stars are too noisy to see of an error that the path itself may have is none of the light's
        let hidden: [f64; 3] = std::array::from_fn(|axis| {
            let most = turns.reference[axis] + HIDDEN * turns.chance(axis);
            unsteady[axis].min(most)
        });
        let steady = (0..2).all(|axis| hidden[axis] < known * known);
        if steady && errs == [false; 3] && lasting.iter().all(Option::is_none) {
            return light;
        }
        let exact = (1e-3 * known * known).recip();
        let information = |axis: usize| match errs[axis] {
            true => turns.reference[axis].recip().min(exact),
            false => hidden[axis].recip().min(exact),
        };
        (std::array::from_fn(information), lasting)
    };
    let mut around = around(data, &turns, reference);
    for (axis, lasting) in lasting.iter().enumerate() {
        if let Some(lasting) = lasting {
            // no prior of each frame anew
            reference[axis] = 0.0;
            let told = lasting.around(axis, &turns, t_s);
            around
                .iter_mut()
                .zip(told)
                .for_each(|(around, told)| around[axis] = told);
        }
    }
    let scale = data.camera.arcsec_per_px();
    let of_frame = |k: usize| {
        let around = &around[k];
        let turn = turns.frames[k].as_ref();
        let known = turn.and_then(|turn| {
            let (mut normal, mut moment) = (turn.normal / turns.noise, turn.moment / turns.noise);
            for (axis, (p, q)) in around.iter().enumerate() {
                normal[(axis, axis)] += reference[axis] + q.recip();
                moment[axis] += p / q;
            }
            let variance = normal.try_inverse()?;
            Some((variance * moment, variance))
        });
        let of_row = move |row: usize| -> Option<[[f64; 2]; 2]> {
            let (theta, variance) = known?;
            let own = rotation_row(data, row).map(Vector3::from);
            Some([0, 1].map(|axis| {
                let a = own[axis] / scale[axis];
                [a.dot(&theta), a.dot(&(variance * a)).max(0.0)]
            }))
        };
        data.frames.rows_of(k).map(of_row)
    };
    let each: Vec<_> = (0..around.len())
        .into_par_iter()
        .flat_map_iter(of_frame)
        .collect();
    for (row, known) in each.into_iter().enumerate() {
        for (axis, [beside, variance]) in known.into_iter().flatten().enumerate() {
            light.beside_px[axis][row] = beside;
            light.variance_px2[axis][row] = variance;
        }
    }
    light
}

/// Variance of the modelled attitudes that their neighbours do not tell, arcsec^2: of the motion, or of the reference.
fn unsteady(data: &StarData) -> [f64; 3] {
    let series = AttitudeSeries::new(data.frames.t_s.clone(), data.attitude.clone(), None);
    let Ok(series) = series else {
        return [0.0; 3];
    };
    let error = of_samples(&series, SIDE) / predicted(SIDE);
    let square = ARCSEC_PER_RAD * ARCSEC_PER_RAD;
    std::array::from_fn(|axis| square * error[axis])
}

/// What the frames around each frame say of its rotation.
fn around(data: &StarData, turns: &Turns, reference: [f64; 3]) -> Vec<Known> {
    let frames = data.frames.frames();
    // each frame by itself
    let own: Vec<Known> = turns
        .frames
        .iter()
        .map(|turn| {
            let turn = turn.as_ref()?;
            let normal = turn.normal / turns.noise + Matrix3::from_diagonal(&reference.into());
            let variance = normal.try_inverse()?;
            let theta = variance * turn.moment / turns.noise;
            Some(std::array::from_fn(|a| (theta[a], variance[(a, a)])))
        })
        .map(|known| known.unwrap_or(NOTHING))
        .collect();
    let attitude: Vec<UnitQuaternion<f64>> = own
        .iter()
        .zip(&data.attitude)
        .map(|(own, q)| {
            rotation_from_vector(&(Vector3::from(own.map(|(v, _)| v)) / ARCSEC_PER_RAD)) * q
        })
        .collect();
    let step_s = median_step(&data.frames.t_s).unwrap_or(f64::INFINITY);
    let predicted: Vec<Known> = (0..frames)
        .into_par_iter()
        .map(|k| predict(data, &own, &attitude, k, step_s))
        .collect();
    // how much worse than its own sigma each was predicted, arcsec^2, what that said, and whether it says anything
    let judge = |own: &Known, predicted: &Known| {
        let about = |a: usize| {
            let ((y, v), (p, q)) = (own[a], predicted[a]);
            let said = v + q;
            match said.is_finite() {
                true => Vector3::new((y - p).powi(2) - said, said, 1.0),
                false => Vector3::zeros(),
            }
        };
        Matrix3::from_columns(&[0, 1, 2].map(about))
    };
    let each = own.iter().zip(&predicted);
    let judges: Vec<Matrix3<f64>> = each.map(|(own, said)| judge(own, said)).collect();
    (0..frames)
        .into_par_iter()
        .map(|k| {
            let before = &judges[k.saturating_sub(JUDGES)..k];
            let after = &judges[k + 1..(k + JUDGES + 1).min(frames)];
            let sums: Matrix3<f64> = before.iter().chain(after).sum();
            std::array::from_fn(|a| {
                let (p, q) = predicted[k][a];
                let [beyond, said, count] = sums.column(a).into_owned().into();
                if count < FEWEST as f64 {
                    return (0.0, f64::INFINITY);
                }
                // a mean square of so many has this scatter
                let chance = 2.0 * (2.0 / count).sqrt() * said / count;
                let beyond = beyond / count;
                (p, if beyond > chance { q + beyond } else { q })
            })
        })
        .collect()
}

/// Frame `k` by the frames around it alone.
fn predict(
    data: &StarData,
    own: &[Known],
    attitude: &[UnitQuaternion<f64>],
    k: usize,
    step_s: f64,
) -> Known {
    let t_s = &data.frames.t_s;
    let gap = GAP_STEPS * step_s;
    let mut fits = [Fit::default(); 3];
    let mut best = NOTHING;
    // what all shorter stretches agree with
    let mut within = [[f64::NEG_INFINITY, f64::INFINITY]; 3];
    let mut open = [true; 3];
    let mut sides = [true; 2];
    for m in 1..=MOST {
        let at = [k.checked_sub(m), Some(k + m).filter(|&j| j < t_s.len())];
        for (side, at) in at.into_iter().enumerate() {
            // the one before on this side, on which it follows
            let joined = at.filter(|&j| {
                let towards = if side == 0 { j + 1 } else { j - 1 };
                (t_s[j] - t_s[towards]).abs() <= gap
            });
            let Some(j) = joined.filter(|_| sides[side]) else {
                sides[side] = false;
                continue;
            };
            let phi = rotation_vector(&attitude[j], &data.attitude[k]) * ARCSEC_PER_RAD;
            for (a, fit) in fits.iter_mut().enumerate() {
                let (_, variance) = own[j][a];
                fit.add((t_s[j] - t_s[k]) / step_s, phi[a], variance.recip());
            }
        }
        if m < FEWEST {
            continue;
        }
        for a in 0..3 {
            let Some((p, q)) = fits[a].now().filter(|_| open[a]) else {
                continue;
            };
            let half = AGREE * q.sqrt();
            let [low, high] = within[a];
            within[a] = [low.max(p - half), high.min(p + half)];
            if within[a][0] > within[a][1] {
                open[a] = false;
            } else {
                best[a] = (p, q);
            }
        }
        if open == [false; 3] || sides == [false; 2] {
            break;
        }
    }
    best
}

/// Sums of a weighted quadratic in time.
#[derive(Clone, Copy, Default)]
struct Fit {
    /// Sums of w s^i, and of w s^i y.
    powers: [f64; 5],
    moments: [f64; 3],
    count: u32,
}

impl Fit {
    fn add(&mut self, s: f64, y: f64, w: f64) {
        let mut power = w;
        for i in 0..5 {
            self.powers[i] += power;
            if i < 3 {
                self.moments[i] += power * y;
            }
            power *= s;
        }
        self.count += u32::from(w > 0.0);
    }

    /// Value at s = 0 and its variance.
    fn now(&self) -> Option<(f64, f64)> {
        // one more than it takes
        if self.count < 4 {
            return None;
        }
        // the first column of the inverse of the matrix of powers i + j
        let [p0, p1, p2, p3, p4] = self.powers;
        let minors = [p2 * p4 - p3 * p3, p2 * p3 - p1 * p4, p1 * p3 - p2 * p2];
        let determinant = p0 * minors[0] + p1 * minors[1] + p2 * minors[2];
        let [m0, m1, m2] = self.moments;
        let value = (minors[0] * m0 + minors[1] * m1 + minors[2] * m2) / determinant;
        let variance = minors[0] / determinant;
        (determinant != 0.0 && variance > 0.0).then_some((value, variance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::star::harness::seen;
    use focal_plane::{AttitudeSeries, Camera, StarFrames};
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    const FRAMES: usize = 1200;
    const STARS: [[f64; 2]; 5] = [
        [300.0, 90.0],
        [-250.0, 330.0],
        [-160.0, -320.0],
        [190.0, -190.0],
        [10.0, 60.0],
    ];
    /// Noise of a centroid and of the reference, px.
    const CENTROID: f64 = 0.2;
    const REFERENCE: f64 = 0.15;

    /// What was made of a path of the boresight (px), and by how much each row's light fell beside its
    /// modelled position, px; its residual too.
    struct Made {
        data: StarData,
        light: Light,
        truth: [Vec<f64>; 2],
        residual: [Vec<f64>; 2],
    }

    type At<'a> = &'a dyn Fn(f64, &mut dyn FnMut() -> f64) -> [f64; 2];

    fn made(path: At<'_>, free: bool) -> Made {
        made_beside(
            path,
            &|_, normal| [REFERENCE * normal(), REFERENCE * normal()],
            free,
        )
    }

    /// The same beside a reference that errs like this.
    fn made_beside(path: At<'_>, error: At<'_>, free: bool) -> Made {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(11);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let camera = Camera::from_fov_deg([1024, 1024], [10.0, 10.0]).unwrap();
        let px = camera.arcsec_per_px()[0] / ARCSEC_PER_RAD;
        let direction = |at: [f64; 2]| camera.direction(focal_plane::Pixel { x: at[0], y: at[1] });
        let turn = |[x, y]: [f64; 2]| rotation_from_vector(&Vector3::new(-y * px, x * px, 0.0));
        let mut frames = StarFrames::new();
        let (mut t_s, mut q) = (Vec::new(), Vec::new());
        let mut places = [Vec::new(), Vec::new()];
        for k in 0..FRAMES {
            let t = 0.2 * k as f64;
            let at = path(t, &mut normal);
            let true_q = turn(at);
            frames.begin(t);
            for (s, star) in STARS.iter().enumerate() {
                let p = camera.project(&(true_q * direction(*star))).unwrap();
                places[0].push(p.x);
                places[1].push(p.y);
                let (x, y) = (p.x + CENTROID * normal(), p.y + CENTROID * normal());
                let s = i32::try_from(s).unwrap();
                frames.push(s, i64::from(s), x, y);
            }
            t_s.push(t);
            q.push(turn(error(t, &mut normal)) * true_q);
        }
        let reference = AttitudeSeries::new(t_s, q, None).unwrap();
        let data = seen(&camera, &frames, (!free).then_some(&reference), &STARS);
        let residual = data.measured_residual();
        let light = of(&data, residual.each_ref().map(Vec::as_slice));
        let truth = std::array::from_fn(|a| {
            let modelled = &data.modelled[a];
            places[a].iter().zip(modelled).map(|(p, m)| p - m).collect()
        });
        let scale = camera.arcsec_per_px();
        let residual = std::array::from_fn(|a| residual[a].iter().map(|r| r / scale[a]).collect());
        Made {
            data,
            light,
            truth,
            residual,
        }
    }

    impl Made {
        /// Mean square error of the position, what it claims, and the mean product of the error with the
        /// residual, px^2.
        fn errors(&self) -> [f64; 3] {
            let mut sums = [0.0; 3];
            for axis in 0..2 {
                for (row, truth) in self.truth[axis].iter().enumerate() {
                    let off = self.light.beside_px[axis][row] - truth;
                    sums[0] += off * off;
                    sums[1] += self.light.variance_px2[axis][row];
                    sums[2] += off * self.residual[axis][row];
                }
            }
            sums.map(|s| s / (2 * self.data.t_s.len()) as f64)
        }
    }

    fn slowly(t: f64) -> [f64; 2] {
        [0.02 * t + 0.3 * (0.05 * t).sin(), 0.4 * (0.04 * t).cos()]
    }

    fn jitter(_: f64, normal: &mut dyn FnMut() -> f64) -> [f64; 2] {
        [3.0 * normal(), 3.0 * normal()]
    }

    /// At 5 Hz the frames around tell a slow motion to a tenth of the variance of one frame, 1/S + 1/N with
    /// S = 0.15^2 and N = 0.2^2 / 5 and more: 0.0059 px^2 and more by stars and reference, 0.0007 with up
    /// to 32 frames (9/4 over their number) and the shorter stretches where the motion bends. The error's
    /// scatter is claimed: a mean of 2400 independent frames of two axes is known to 3 %, but neighbours
    /// share most of theirs, 10 %, and the judges let half of that be: within 30 %.
    #[test]
    fn slow_motion_is_known_from_the_frames_around() {
        for free in [false, true] {
            let [square, claimed, _] = made(&|t, _| slowly(t), free).errors();
            assert!(square < 2e-3, "{free}: {square}");
            assert!(
                (0.7..1.3).contains(&(square / claimed)),
                "{square} {claimed}"
            );
        }
    }

    /// Where each frame is somewhere else, its own stars and the reference are all there is: what the frames
    /// around say is no more believed than it is worth. Of 24 000 numbers, five by five of one rotation, a
    /// mean square is known to 2.5 %; the reference's variance from 1200 frames to 6 %.
    #[test]
    fn jitter_between_the_frames_is_not_smoothed() {
        for free in [false, true] {
            let [square, claimed, _] = made(&jitter, free).errors();
            assert!(
                (0.85..1.15).contains(&(square / claimed)),
                "{square} {claimed}"
            );
        }
    }

    /// A step of 0.3 px in the reference is no noise of every frame anew: five stars know a frame's place to 0.2^2/5 =
    /// 0.008 px^2, 32 frames around that to 9/4 over their number, 0.0006, and less near the step and where shorter
    /// stretches agree, however the camera moves. Taken for white noise of 0.15 px it left a quarter of itself, 0.15^2/16 =
    /// 0.0014, by slow motion, and (1/0.15^2 + 1/0.008)^-1 = 0.006 by jitter.
    #[test]
    fn a_slow_error_of_the_reference_is_known_from_the_frames_around() {
        let half = 0.1 * FRAMES as f64;
        let step = |t: f64, _: &mut dyn FnMut() -> f64| [if t < half { 0.15 } else { -0.15 }; 2];
        let slow = |t: f64, _: &mut dyn FnMut() -> f64| slowly(t);
        let paths: [At<'_>; 2] = [&jitter, &slow];
        for path in paths {
            let made = made_beside(path, &step, false);
            let [square, claimed, _] = made.errors();
            assert!(square < 1.1e-3, "{square}");
            assert!(
                (0.7..1.3).contains(&(square / claimed)),
                "{square} {claimed}"
            );
            // no half is off as a whole: 600 frames, of which some 30 share what they know
            let mean = |early: bool| {
                let rows = (0..made.data.t_s.len()).filter(|&r| (made.data.t_s[r] < half) == early);
                let off = rows.map(|r| made.light.beside_px[0][r] - made.truth[0][r]);
                let off: Vec<f64> = off.collect();
                off.iter().sum::<f64>() / off.len() as f64
            };
            let known = (0.008_f64 / 600.0).sqrt();
            for early in [true, false] {
                assert!(mean(early).abs() < 5.0 * known, "{}", mean(early));
            }
        }
    }

    /// What a position errs by has nothing in common with the star's residual: nothing that falls with the position
    /// explains the reference's noise, nor the star's own. Told by the frame's other stars, it would have minus what it
    /// still errs by of the reference, 0.006 px^2. The product of 0.08 and 0.25 px has a mean known to
    /// 0.08 x 0.25 / sqrt(12000 / 2.5) = 0.0003, and a reference's variance that is off by 6 % leaves as much of it.
    #[test]
    fn what_a_position_errs_by_is_not_in_the_residual() {
        for free in [false, true] {
            let [_, _, product] = made(&jitter, free).errors();
            assert!(product.abs() < 1.5e-3, "{free}: {product}");
        }
    }

    /// The same where the error of the reference lasts for three frames or so: 0.15 px of which what is new in a frame
    /// is 0.15^2 (1 - exp(-1/3)) = 0.0064 px^2. Neighbours that are told as if each had an error of its own share
    /// it, and leave a third of the variance in the product, 0.002. A hundred walks of 12 frames on each side of every
    /// frame are 1200 / 24 = 50 independent means of 24 x 5 x 2 products, known to 0.0002.
    #[test]
    fn nor_is_what_lasts_from_frame_to_frame() {
        let walk = std::cell::Cell::new([0.0; 2]);
        let keep = (-1.0_f64 / 3.0).exp();
        let lasts = |_: f64, normal: &mut dyn FnMut() -> f64| {
            let fresh = REFERENCE * (1.0 - keep * keep).sqrt();
            walk.set(walk.get().map(|w| keep * w + fresh * normal()));
            walk.get()
        };
        let at_rest = |_: f64, _: &mut dyn FnMut() -> f64| [0.0; 2];
        let paths: [At<'_>; 2] = [&jitter, &at_rest];
        for path in paths {
            let [square, claimed, product] = made_beside(path, &lasts, false).errors();
            assert!(product.abs() < 1e-3, "{product}");
            assert!(
                (0.7..1.3).contains(&(square / claimed)),
                "{square} {claimed}"
            );
        }
    }

    /// 0.02 px of the reference, of which five stars of 0.2 px in 1200 frames see nothing: chance makes 0.2^2/5
    /// sqrt(2/1200) = 0.018^2 of their own noise. As modelled, position and residual share minus 0.02^2 = 4e-4 px^2 of it.
    /// Neighbours tell all but a tenth; 0.006 and 0.2 px in 12 000 rows, of which some 24 share what they know, are known
    /// to 5e-5.
    #[test]
    fn nor_is_what_stars_are_too_noisy_to_see() {
        let hidden = |_: f64, normal: &mut dyn FnMut() -> f64| [0.02 * normal(), 0.02 * normal()];
        let slow = |t: f64, _: &mut dyn FnMut() -> f64| slowly(t);
        let at_rest = |_: f64, _: &mut dyn FnMut() -> f64| [0.0; 2];
        let paths: [At<'_>; 2] = [&slow, &at_rest];
        for path in paths {
            let [square, _, product] = made_beside(path, &hidden, false).errors();
            assert!(square < 1.2e-4, "{square}");
            assert!(product.abs() < 1.5e-4, "{product}");
        }
    }
}
