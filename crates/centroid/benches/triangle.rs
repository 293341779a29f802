//! Centroid errors in stars per second, centroids in windows per second.
//!
//! `cargo bench -p centroid --bench triangle`
//!
//! The triangle runs against `asin(sin)` as Eq. 10 prints it, in the same run.

use std::f64::consts::{FRAC_2_PI, TAU};
use std::hint::black_box;

use centroid::{
    CentroidError, EstimatesMut, FirstMoment, GaussianPsf, GaussianWeighted, Harmonic, Harmonics,
    Noise, Triangle, WindowBatch, pixel_gaussian_into,
};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use focal_plane::{Pixel, Points, PointsMut};

/// `[M23] Eq. 10 and 11` as they stand.
fn printed(p: f64, peak: f64) -> f64 {
    peak * FRAC_2_PI * (TAU * (p % 1.0)).sin().asin()
}

fn errors(c: &mut Criterion) {
    let mut group = c.benchmark_group("centroid error of both axes");
    let terms = [Harmonic {
        amplitude: 0.05,
        phase_rad: 0.3,
    }; 3];
    let psf = GaussianPsf::new(0.5, 5).expect("a valid spot");
    let models = [
        (
            "triangle",
            CentroidError::Triangle(Triangle::from_peak(0.07)),
        ),
        (
            "three harmonics",
            CentroidError::Harmonics(Harmonics::new(&terms, &terms)),
        ),
        ("Gaussian spot", CentroidError::GaussianPsf(psf)),
    ];
    for stars in [14_usize, 256, 4096] {
        let x: Vec<f64> = (0..stars).map(|i| 500.0 * (1.7 * i as f64).sin()).collect();
        let y: Vec<f64> = (0..stars).map(|i| 500.0 * (2.3 * i as f64).cos()).collect();
        let (mut ex, mut ey) = (vec![0.0; stars], vec![0.0; stars]);
        group.throughput(Throughput::Elements(stars as u64));
        for (name, model) in &models {
            group.bench_function(BenchmarkId::new(*name, stars), |bench| {
                bench.iter(|| {
                    let out = PointsMut {
                        x: &mut ex,
                        y: &mut ey,
                    };
                    black_box(model).error_into(Points { x: &x, y: &y }, 0.5, out);
                    black_box((&ex, &ey));
                });
            });
        }
        group.bench_function(BenchmarkId::new("triangle as printed", stars), |bench| {
            bench.iter(|| {
                let peak = black_box(0.07);
                for i in 0..stars {
                    ex[i] = printed(x[i], peak);
                    ey[i] = printed(y[i], peak);
                }
                black_box((&ex, &ey));
            });
        });
    }
    group.finish();
}

fn windows(c: &mut Criterion) {
    let mut group = c.benchmark_group("centroids of 6 x 6 windows");
    let n = 256_usize;
    let mut values = vec![0.0; 36 * n];
    for (i, window) in values.chunks_exact_mut(36).enumerate() {
        let shift = 0.4 * (i as f64).sin();
        let (first, at) = (
            Pixel { x: 0.5, y: 0.5 },
            Pixel {
                x: 3.0 + shift,
                y: 3.0 - shift,
            },
        );
        pixel_gaussian_into(first, 6, at, 0.8, 5000.0, window).expect("a valid spot");
    }
    let (place, background) = (vec![0.5; n], vec![0.0; n]);
    let batch = WindowBatch {
        values: &values,
        columns: 6,
        rows: 6,
        x0_px: &place,
        y0_px: &place,
        background: &background,
        background_sigma: 0.5,
        unread: None,
    };
    let noise = Noise::Detector {
        gain_e: 2.0,
        read_noise_e: 10.0,
        pedestal: 0.0,
    };
    let [mut x, mut y, mut sx, mut sy, mut flux] = [(); 5].map(|()| vec![0.0; n]);
    let mut failure = vec![None; n];
    group.throughput(Throughput::Elements(n as u64));
    macro_rules! run {
        ($name:literal, $estimator:expr) => {
            group.bench_function($name, |bench| {
                let estimator = $estimator;
                bench.iter(|| {
                    let out = EstimatesMut {
                        x_px: &mut x,
                        y_px: &mut y,
                        sigma_x_px: &mut sx,
                        sigma_y_px: &mut sy,
                        flux: &mut flux,
                        failure: &mut failure,
                    };
                    black_box(black_box(&estimator).estimate_into(&batch, &noise, out))
                });
            });
        };
    }
    run!("first moment", FirstMoment::default());
    run!("Gaussian weight", GaussianWeighted::new(0.8));
    run!(
        "Gaussian weight, spot known",
        GaussianWeighted::matched(0.8)
    );
    group.finish();
}

criterion_group!(benches, errors, windows);
criterion_main!(benches);
