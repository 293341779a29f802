//! Throughput of the kernels, in stars (or times, for attitudes).

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use focal_plane::{
    AttitudeSeries, AttitudeSource, Camera, Points, PointsMut, Quaternions, QuaternionsMut,
    Vectors, VectorsMut, rotate_each_into, rotate_into, rotation_from_vector, rotation_vector,
};
use nalgebra::{UnitQuaternion, Vector3};

const SIZES: [u32; 3] = [16, 256, 4096];

struct Columns([Vec<f64>; 6]);

impl Columns {
    fn new(stars: u32) -> Self {
        let spread = |a: f64| {
            (0..stars)
                .map(|k| 0.17 * (a * f64::from(k)).sin())
                .collect()
        };
        let n = stars as usize;
        Self([
            spread(1.7),
            spread(2.3),
            vec![0.97; n],
            vec![0.0; n],
            vec![0.0; n],
            vec![0.0; n],
        ])
    }

    fn split(&mut self) -> (Vectors<'_>, VectorsMut<'_>) {
        let [x, y, z, a, b, c] = &mut self.0;
        (Vectors { x, y, z }, VectorsMut { x: a, y: b, z: c })
    }
}

fn camera() -> Camera {
    Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).expect("a valid camera")
}

fn kernels(c: &mut Criterion) {
    let camera = camera();
    let q = rotation_from_vector(&Vector3::new(0.01, -0.02, 0.5));
    for stars in SIZES {
        let mut columns = Columns::new(stars);
        let mut group = c.benchmark_group("stars");
        group.throughput(Throughput::Elements(u64::from(stars)));
        let (v, mut out) = columns.split();
        group.bench_function(BenchmarkId::new("project_into", stars), |b| {
            b.iter(|| {
                let out = out.reborrow();
                black_box(&camera).project_into(v, PointsMut { x: out.x, y: out.y });
            });
        });
        group.bench_function(BenchmarkId::new("direction_into", stars), |b| {
            b.iter(|| {
                black_box(&camera).direction_into(Points { x: v.x, y: v.y }, out.reborrow());
            });
        });
        group.bench_function(BenchmarkId::new("phase_into", stars), |b| {
            b.iter(|| black_box(&camera).phase_into(v.x, out.x));
        });
        group.bench_function(BenchmarkId::new("rotate_into", stars), |b| {
            b.iter(|| rotate_into(black_box(&q), v, out.reborrow()));
        });
        let each = [q.i, q.j, q.k, q.w].map(|component| vec![component; stars as usize]);
        group.bench_function(BenchmarkId::new("rotate_each_into", stars), |b| {
            b.iter(|| {
                let q = Quaternions {
                    x: &each[0],
                    y: &each[1],
                    z: &each[2],
                    w: &each[3],
                };
                rotate_each_into(black_box(q), v, out.reborrow());
            });
        });
        group.finish();
    }
}

fn attitudes(c: &mut Criterion) {
    let t_s: Vec<f64> = (0..10_000).map(|k| 0.5 * f64::from(k)).collect();
    let turn = |t: f64| rotation_from_vector(&Vector3::new(0.1 * (0.2 * t).sin(), 1e-3 * t, 0.3));
    let q: Vec<UnitQuaternion<f64>> = t_s.iter().map(|&t| turn(t)).collect();
    let series = AttitudeSeries::new(t_s, q, None).expect("valid samples");
    let times: Vec<f64> = (0..4096).map(|k| 1.1 * f64::from(k)).collect();
    let mut out = [0, 1, 2, 3].map(|_| vec![0.0; times.len()]);
    let mut group = c.benchmark_group("attitudes");
    group.throughput(Throughput::Elements(times.len() as u64));
    group.bench_function("attitude_into", |b| {
        b.iter(|| {
            let [x, y, z, w] = &mut out;
            series.attitude_into(black_box(&times), QuaternionsMut { x, y, z, w });
        });
    });
    group.bench_function("attitude", |b| {
        b.iter(|| {
            times
                .iter()
                .filter_map(|&t| series.attitude(t))
                .map(|q| q.w)
                .sum::<f64>()
        });
    });
    // fourteen rows of a frame, each at its own instant
    let rows: Vec<f64> = (0..4096)
        .map(|i| 1.1 * f64::from(i / 14) + 1e-3 * f64::from((i * 5) % 14 - 7))
        .filter(|t| *t >= 0.0)
        .collect();
    group.bench_function("attitude_of_rows", |b| {
        let each = rows.iter().filter_map(|&t| series.attitude(t));
        b.iter(|| each.clone().map(|q| q.w).sum::<f64>());
    });
    group.bench_function("attitude_near_of_rows", |b| {
        b.iter(|| {
            let mut hint = 0;
            rows.iter()
                .filter_map(|&t| series.attitude_near(t, &mut hint))
                .map(|q| q.w)
                .sum::<f64>()
        });
    });
    group.bench_function("rotation_vector", |b| {
        let q = series.quaternions();
        b.iter(|| {
            (1..4097)
                .map(|i| rotation_vector(&q[i], &q[i - 1]).x)
                .sum::<f64>()
        });
    });
    group.finish();
}

criterion_group!(benches, kernels, attitudes);
criterion_main!(benches);
