//! Samples simulated and series fitted per second.
//!
//! `cargo bench -p fogm-fit`

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fogm_fit::{
    Convention, FitOptions, Fogm, FogmError, FogmWhite, fit_log_psd, fit_psd, fit_series,
};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use spectra::Psd;

fn process() -> Result<FogmWhite, FogmError> {
    FogmWhite::new(Fogm::new(3.58, 20.0)?, 7.43)
}

fn simulate(c: &mut Criterion) {
    let Ok(process) = process() else { return };
    let mut group = c.benchmark_group("simulate");
    let mut out = vec![0.0; 10_000];
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    group.throughput(Throughput::Elements(out.len() as u64));
    group.bench_function("fogm_white", |b| {
        b.iter(|| process.simulate_into(0.1, &mut rng, black_box(&mut out)));
    });
    group.bench_function("fogm", |b| {
        b.iter(|| {
            process
                .fogm()
                .simulate_into(0.1, &mut rng, black_box(&mut out));
        });
    });
    group.finish();
}

fn fit(c: &mut Criterion) {
    let Ok(process) = process() else { return };
    let mut group = c.benchmark_group("fit");
    group.sample_size(20);
    let options = FitOptions::default();
    for n in [1000_usize, 10_000, 100_000] {
        let mut y = vec![0.0; n];
        process.simulate_into(0.1, &mut Xoshiro256PlusPlus::seed_from_u64(2), &mut y);
        group.bench_function(BenchmarkId::new("series", n), |b| {
            b.iter(|| fit_series(black_box(&y), 10.0, &options));
        });
        let band = FitOptions {
            band_hz: Some([0.0, 4.9]),
            ..FitOptions::default()
        };
        group.bench_function(BenchmarkId::new("series_in_band", n), |b| {
            b.iter(|| fit_series(black_box(&y), 10.0, &band));
        });
    }
    let bins = 200;
    let frequency_hz: Vec<f64> = (1..=bins).map(|j| 5.0 * f64::from(j) / 201.0).collect();
    let psd = Psd {
        psd: frequency_hz
            .iter()
            .map(|f| fogm_fit::sampled(process, *f, 10.0))
            .collect(),
        dof: vec![40.0; frequency_hz.len()],
        frequency_hz,
        fs_hz: 10.0,
    };
    group.bench_function("psd/200", |b| b.iter(|| fit_psd(black_box(&psd), &options)));
    group.bench_function("log_psd_as_printed/200", |b| {
        b.iter(|| fit_log_psd(black_box(&psd), Convention::AsPrinted, &options));
    });
    group.finish();
}

criterion_group!(benches, simulate, fit);
criterion_main!(benches);
