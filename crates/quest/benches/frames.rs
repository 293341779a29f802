//! Frames of 14 stars per second: one by one, in a batch, and by nalgebra's eigensolver, so that
//! the ratios come from one run.
//!
//! `cargo bench -p quest`; add `RUSTFLAGS="-C target-cpu=native"` to see what wider lanes give.

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use nalgebra::{Matrix3, Matrix4, Quaternion, UnitQuaternion, Vector3, Vector4};
use quest::{FrameStatus, ProfileBatch, QuaternionsMut, Vectors, quest, solve_batch_into};
use rand_distr::{Distribution, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;

const FRAMES: usize = 1024;
const STARS: usize = 14;

/// What the frames ask of the solver.
#[derive(Clone, Copy, Debug)]
enum Kind {
    /// 20 degrees, one attitude for all: the first pass does.
    Field,
    /// The same turned by 180 degrees: sequential rotation.
    HalfTurn,
    /// 1 degree: polished.
    Narrow,
}

struct Frames {
    measured: Vec<Vector3<f64>>,
    reference: Vec<Vector3<f64>>,
    weights: Vec<f64>,
    first_row: Vec<usize>,
    columns: [Vec<f64>; 6],
    profiles: ProfileBatch,
}

impl Frames {
    fn of(kind: Kind) -> Self {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
        let (field_deg, q) = match kind {
            Kind::Field => (20.0_f64, UnitQuaternion::from_euler_angles(0.3, -0.4, 0.5)),
            Kind::HalfTurn => {
                let axis = Vector3::new(0.6, 0.64, 0.48);
                (
                    20.0,
                    UnitQuaternion::new_unchecked(Quaternion::from_parts(0.0, axis)),
                )
            }
            Kind::Narrow => (1.0, UnitQuaternion::from_euler_angles(0.3, -0.4, 0.5)),
        };
        let (mut measured, mut reference) = (vec![], vec![]);
        for _ in 0..FRAMES * STARS {
            let u: f64 = StandardUniform.sample(&mut rng);
            let p: f64 = StandardUniform.sample(&mut rng);
            let (r, p) = (
                (field_deg / 2.0).to_radians() * u.sqrt(),
                std::f64::consts::TAU * p,
            );
            let w = Vector3::new(r.sin() * p.cos(), r.sin() * p.sin(), r.cos());
            let n: [f64; 3] = std::array::from_fn(|_| StandardNormal.sample(&mut rng));
            reference.push(q.inverse() * w);
            measured.push((w + Vector3::from(n) * 5e-5).normalize());
        }
        let columns: [Vec<f64>; 6] = std::array::from_fn(|k| {
            let set = if k < 3 { &measured } else { &reference };
            set.iter().map(|v| v[k % 3]).collect()
        });
        let mut out = Self {
            measured,
            reference,
            weights: vec![1.0; FRAMES * STARS],
            first_row: (0..=FRAMES).map(|k| k * STARS).collect(),
            columns,
            profiles: ProfileBatch::default(),
        };
        let mut profiles = ProfileBatch::default();
        out.accumulate(&mut profiles);
        out.profiles = profiles;
        out
    }

    fn accumulate(&self, profiles: &mut ProfileBatch) {
        let [wx, wy, wz, vx, vy, vz] = &self.columns;
        let w = Vectors {
            x: wx,
            y: wy,
            z: wz,
        };
        let v = Vectors {
            x: vx,
            y: vy,
            z: vz,
        };
        profiles.accumulate(w, v, &self.weights, &self.first_row);
    }
}

struct Out {
    q: [Vec<f64>; 4],
    status: Vec<FrameStatus>,
}

impl Out {
    fn new() -> Self {
        Self {
            q: std::array::from_fn(|_| vec![0.0; FRAMES]),
            status: vec![FrameStatus::default(); FRAMES],
        }
    }

    fn solve(&mut self, profiles: &ProfileBatch) -> usize {
        let [x, y, z, w] = &mut self.q;
        solve_batch_into(profiles, QuaternionsMut { x, y, z, w }, &mut self.status)
    }
}

fn eigenvector(b: &Matrix3<f64>) -> Vector4<f64> {
    let (s, t) = (b.trace(), b.transpose());
    let (m, d) = (b + t, b - t);
    let k = Matrix4::new(
        m[(0, 0)] - s,
        m[(0, 1)],
        m[(0, 2)],
        d[(2, 1)],
        m[(1, 0)],
        m[(1, 1)] - s,
        m[(1, 2)],
        d[(0, 2)],
        m[(2, 0)],
        m[(2, 1)],
        m[(2, 2)] - s,
        d[(1, 0)],
        d[(2, 1)],
        d[(0, 2)],
        d[(1, 0)],
        s,
    );
    let eigen = k.symmetric_eigen();
    eigen
        .eigenvectors
        .column(eigen.eigenvalues.imax())
        .into_owned()
}

fn from_profiles(c: &mut Criterion) {
    let mut group = c.benchmark_group("profile_to_quaternion");
    group.throughput(Throughput::Elements(FRAMES as u64));
    for kind in [Kind::Field, Kind::HalfTurn, Kind::Narrow] {
        let frames = Frames::of(kind);
        let single: Vec<_> = (0..FRAMES).map(|k| frames.profiles.profile(k)).collect();
        let matrices: Vec<_> = single.iter().map(|p| p.matrix()).collect();
        let mut out = Out::new();
        assert_eq!(out.solve(&frames.profiles), FRAMES);
        group.bench_function(BenchmarkId::new("one_by_one", format!("{kind:?}")), |b| {
            b.iter(|| {
                for profile in &single {
                    let _ = black_box(black_box(profile).solve());
                }
            });
        });
        group.bench_function(BenchmarkId::new("batch", format!("{kind:?}")), |b| {
            b.iter(|| out.solve(black_box(&frames.profiles)));
        });
        group.bench_function(
            BenchmarkId::new("symmetric_eigen", format!("{kind:?}")),
            |b| {
                b.iter(|| {
                    for matrix in &matrices {
                        black_box(eigenvector(black_box(matrix)));
                    }
                });
            },
        );
    }
    group.finish();
}

fn from_stars(c: &mut Criterion) {
    let mut group = c.benchmark_group("stars_to_quaternion");
    group.throughput(Throughput::Elements(FRAMES as u64));
    let frames = Frames::of(Kind::Field);
    group.bench_function("one_by_one_with_covariance", |b| {
        b.iter(|| {
            for ends in frames.first_row.windows(2) {
                let rows = ends[0]..ends[1];
                let (w, v) = (
                    &frames.measured[rows.clone()],
                    &frames.reference[rows.clone()],
                );
                let _ = black_box(quest(black_box(w), black_box(v), &frames.weights[rows]));
            }
        });
    });
    let (mut profiles, mut out) = (ProfileBatch::default(), Out::new());
    group.bench_function("batch", |b| {
        b.iter(|| {
            black_box(&frames).accumulate(&mut profiles);
            out.solve(&profiles)
        });
    });
    group.bench_function("symmetric_eigen", |b| {
        b.iter(|| {
            for ends in frames.first_row.windows(2) {
                let mut m = Matrix3::zeros();
                for k in ends[0]..ends[1] {
                    m += frames.measured[k] * frames.reference[k].transpose() * frames.weights[k];
                }
                black_box(eigenvector(&m));
            }
        });
    });
    group.finish();
}

criterion_group!(benches, from_profiles, from_stars);
criterion_main!(benches);
