//! Two polynomials per star, in stars per second: the batch against the double sum of Eq. 5
//! written as it stands.
//!
//! `cargo bench -p distortion --bench polynomial`

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use distortion::{DistortionField, LsfSigma};
use focal_plane::{Angle, Points, PointsMut};
use rand_xoshiro::{Xoshiro256PlusPlus, rand_core::SeedableRng};

/// `[M23] Eq. 5`, term by term with integer powers.
fn double_sum(coefficients: &[f64], order: i32, x: f64, y: f64) -> f64 {
    let mut terms = coefficients.iter();
    let mut sum = 0.0;
    for j in 0..=order {
        for k in 0..=order {
            sum += terms.next().copied().unwrap_or(0.0) * x.powi(k) * y.powi(j);
        }
    }
    sum
}

fn polynomials(c: &mut Criterion) {
    let mut group = c.benchmark_group("two polynomials of order 7");
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    let sigma = LsfSigma::Circular(Angle::from_arcsec(3.1667));
    let field = DistortionField::draw(7, sigma, &mut rng).expect("a valid order and sigma");
    for stars in [14_usize, 256, 4096] {
        let x: Vec<f64> = (0..stars).map(|i| (1.7 * i as f64).sin()).collect();
        let y: Vec<f64> = (0..stars).map(|i| (2.3 * i as f64).cos()).collect();
        let (mut dx, mut dy) = (vec![0.0; stars], vec![0.0; stars]);
        group.throughput(Throughput::Elements(stars as u64));
        group.bench_function(BenchmarkId::new("batch", stars), |bench| {
            bench.iter(|| {
                black_box(&field).evaluate_into(
                    Points { x: &x, y: &y },
                    PointsMut {
                        x: &mut dx,
                        y: &mut dy,
                    },
                );
                black_box((&dx, &dy));
            });
        });
        group.bench_function(BenchmarkId::new("double sum", stars), |bench| {
            bench.iter(|| {
                let field = black_box(&field);
                for i in 0..stars {
                    dx[i] = double_sum(field.a(), 7, x[i], y[i]);
                    dy[i] = double_sum(field.b(), 7, x[i], y[i]);
                }
                black_box((&dx, &dy));
            });
        });
    }
    group.finish();
}

criterion_group!(benches, polynomials);
criterion_main!(benches);
