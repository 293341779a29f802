//! The batch against the single frame: the same bits from the same profile, and the documented
//! tolerance from the same stars.

use nalgebra::{Quaternion, UnitQuaternion};
use quest::{
    FrameStatus, MIN_GAP, POLISH_GAP, Profile, ProfileBatch, QuaternionsMut, QuestError, Vectors,
    quest, solve_batch_into,
};

use crate::cases::{Draw, Stars, angle};

struct Solved {
    q: [Vec<f64>; 4],
    status: Vec<FrameStatus>,
    count: usize,
}

impl Solved {
    fn of(profiles: &ProfileBatch) -> Self {
        let n = profiles.frames();
        let mut q: [Vec<f64>; 4] = std::array::from_fn(|_| vec![7.0; n]);
        let mut status = vec![FrameStatus::default(); n];
        let [x, y, z, w] = &mut q;
        let count = solve_batch_into(profiles, QuaternionsMut { x, y, z, w }, &mut status);
        Self { q, status, count }
    }

    fn quaternion(&self, k: usize) -> UnitQuaternion<f64> {
        let [x, y, z, w] = &self.q;
        UnitQuaternion::new_unchecked(Quaternion::new(w[k], x[k], y[k], z[k]))
    }
}

#[derive(Default)]
struct Columns {
    w: [Vec<f64>; 3],
    v: [Vec<f64>; 3],
    weights: Vec<f64>,
    first_row: Vec<usize>,
}

impl Columns {
    fn of(frames: &[Stars]) -> Self {
        let mut out = Self {
            first_row: vec![0],
            ..Self::default()
        };
        for stars in frames {
            for i in 0..3 {
                out.w[i].extend(stars.measured.iter().map(|w| w[i]));
                out.v[i].extend(stars.reference.iter().map(|v| v[i]));
            }
            out.weights.extend(&stars.weights);
            out.first_row.push(out.weights.len());
        }
        out
    }

    fn profiles(&self) -> ProfileBatch {
        let ([wx, wy, wz], [vx, vy, vz]) = (&self.w, &self.v);
        let mut out = ProfileBatch::default();
        out.accumulate(
            Vectors {
                x: wx,
                y: wy,
                z: wz,
            },
            Vectors {
                x: vx,
                y: vy,
                z: vz,
            },
            &self.weights,
            &self.first_row,
        );
        out
    }
}

fn frames(seeds: std::ops::Range<u64>) -> Vec<Stars> {
    seeds.map(|seed| Draw::new(seed).stars()).collect()
}

/// Hard and easy frames side by side, so that no lane's neighbour may decide its fate.
#[test]
fn same_bits_as_the_single_frame() {
    let profiles = Columns::of(&frames(0..20_003)).profiles();
    let batch = Solved::of(&profiles);
    let mut ways = [0; 3];
    for k in 0..profiles.frames() {
        match profiles.profile(k).solve() {
            Ok(single) => {
                assert_eq!(batch.status[k], FrameStatus::Solved, "frame {k}");
                assert_eq!(batch.quaternion(k), single.q, "frame {k}");
                ways[match single.iterations {
                    2 => 0,
                    3 => 1,
                    _ => 2,
                }] += 1;
            }
            Err(error) => {
                assert!(
                    matches!(error, QuestError::Degenerate { .. }),
                    "frame {k}: {error}"
                );
                assert_eq!(batch.status[k], FrameStatus::Degenerate, "frame {k}");
                assert!(batch.q.iter().all(|c| c[k].is_nan()), "frame {k}");
            }
        }
    }
    assert_eq!(ways.iter().sum::<usize>(), batch.count);
    assert!(
        ways.iter().all(|&n| n > 2000),
        "every way must be tested: {ways:?}"
    );
}

/// From the stars the two sum in their own ways, so the profiles differ by rounding.
#[test]
fn same_attitude_from_the_same_stars() {
    let frames = frames(30_000..50_000);
    let batch = Solved::of(&Columns::of(&frames).profiles());
    for (k, stars) in frames.iter().enumerate() {
        let Ok(single) = quest(&stars.measured, &stars.reference, &stars.weights) else {
            continue;
        };
        if single.gap < 1.001 * MIN_GAP {
            continue; // rounding may decide
        }
        let (eps, gap) = (f64::EPSILON, single.gap);
        let one = if gap < POLISH_GAP {
            40.0 * eps / gap
        } else {
            40.0 * eps / (gap * gap)
        };
        let apart = angle(&batch.quaternion(k), &single.q);
        assert!(
            apart <= 2.0 * one + 8.0 * eps,
            "frame {k}: {apart:e} at gap {gap:e}"
        );
    }
}

/// Whatever the number of frames and wherever a frame stands in its group, it comes out the same.
#[test]
fn place_in_the_batch_does_not_matter() {
    let all = frames(60_000..60_040);
    let whole = Solved::of(&Columns::of(&all).profiles());
    for (from, to) in [(0, 0), (0, 1), (3, 10), (5, 13), (7, 40)] {
        let part = Solved::of(&Columns::of(&all[from..to]).profiles());
        assert_eq!(part.status, whole.status[from..to]);
        for k in from..to {
            if whole.status[k] == FrameStatus::Solved {
                assert_eq!(
                    part.quaternion(k - from),
                    whole.quaternion(k),
                    "{from}..{to}: {k}"
                );
            }
        }
    }
}

#[test]
fn status_says_why() {
    let mut columns = Columns::of(&frames(70_001..70_002));
    let good = Solved::of(&columns.profiles());
    assert_eq!(good.status, [FrameStatus::Solved]);
    let n = columns.weights.len();

    // a row of weight zero is left out, whatever it holds
    for c in columns.w.iter_mut().chain(&mut columns.v) {
        c.push(f64::NAN);
    }
    columns.weights.push(0.0);
    columns.first_row[1] = n + 1;
    let masked = Solved::of(&columns.profiles());
    assert_eq!((masked.q, masked.status), (good.q, good.status));

    for bad in [1.0, f64::NAN, -1.0] {
        columns.weights[n] = bad;
        let result = Solved::of(&columns.profiles());
        assert_eq!(
            (result.status[0], result.count),
            (FrameStatus::NotFinite, 0),
            "{bad}"
        );
    }
    columns.w[0][n] = 1.0;
    columns.weights[n] = f64::INFINITY;
    assert_eq!(
        Solved::of(&columns.profiles()).status,
        [FrameStatus::NotFinite]
    );

    // no stars, one star
    columns.first_row = vec![0, 0, 1];
    columns.weights.truncate(1);
    for c in columns.w.iter_mut().chain(&mut columns.v) {
        c.truncate(1);
    }
    assert_eq!(
        Solved::of(&columns.profiles()).status,
        [FrameStatus::Degenerate; 2]
    );
}

#[test]
fn profile_by_hand() {
    let mut profiles = ProfileBatch::default();
    profiles.resize(2);
    let third = 1.0 / 3.0;
    profiles.set_profile(
        1,
        Profile([third, 0.0, 0.0, 0.0, third, 0.0, 0.0, 0.0, third]),
    );
    let result = Solved::of(&profiles);
    assert_eq!(
        result.status,
        [FrameStatus::Degenerate, FrameStatus::Solved]
    );
    assert_eq!(result.quaternion(1), UnitQuaternion::identity());
}

#[test]
#[should_panic(expected = "one quaternion a frame")]
fn short_output_is_a_bug() {
    let mut profiles = ProfileBatch::default();
    profiles.resize(3);
    let (mut x, mut y, mut z, mut w) = ([0.0; 3], [0.0; 3], [0.0; 2], [0.0; 3]);
    let out = QuaternionsMut {
        x: &mut x,
        y: &mut y,
        z: &mut z,
        w: &mut w,
    };
    solve_batch_into(&profiles, out, &mut [FrameStatus::default(); 3]);
}
