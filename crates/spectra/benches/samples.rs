//! Samples per second of each estimate, from plans that are made before.
//!
//! `cargo bench -p spectra`

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use rand_xoshiro::rand_core::SeedableRng;
use spectra::{
    Allan, AllanData, AllanKind, Complex, CrossMut, LombScargle, LombScargleSettings, Multitaper,
    MultitaperSettings, PowerLaw, Slepian, Welch, WelchSettings, whole,
};

const SAMPLES: usize = 1 << 16;

fn series(samples: usize) -> Vec<f64> {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(1);
    (0..samples)
        .map(|_| StandardNormal.sample(&mut rng))
        .collect()
}

fn welch(c: &mut Criterion) {
    let (x, y) = (series(SAMPLES), series(SAMPLES));
    let runs = whole(&x);
    let mut group = c.benchmark_group("welch");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    for segment in [256, 4096] {
        let plan = Welch::new(WelchSettings::half_overlap(segment, 1.0)).expect("plan");
        let mut scratch = plan.make_scratch();
        let (mut xx, mut yy) = (vec![0.0; plan.bins()], vec![0.0; plan.bins()]);
        let mut xy = vec![Complex::ZERO; plan.bins()];
        group.bench_function(BenchmarkId::new("one", segment), |b| {
            b.iter(|| plan.process_into(black_box(&x), &runs, &mut scratch, &mut xx));
        });
        group.bench_function(BenchmarkId::new("two", segment), |b| {
            b.iter(|| {
                let out = CrossMut {
                    xx: &mut xx,
                    yy: &mut yy,
                    xy: &mut xy,
                };
                plan.process_cross_into(black_box(&x), &y, &runs, &mut scratch, out)
            });
        });
    }
    group.finish();
}

fn multitaper(c: &mut Criterion) {
    let x = series(SAMPLES);
    let mut group = c.benchmark_group("multitaper");
    group.sample_size(20);
    group.throughput(Throughput::Elements(SAMPLES as u64));
    let plan = Multitaper::new(MultitaperSettings::new(SAMPLES, 4.0, 1.0)).expect("plan");
    let mut scratch = plan.make_scratch();
    let (mut psd, mut dof) = (vec![0.0; plan.bins()], vec![0.0; plan.bins()]);
    group.bench_function("adaptive", |b| {
        b.iter(|| plan.process_into(black_box(&x), &mut scratch, &mut psd, &mut dof));
    });
    let (mut f, mut amplitude) = (psd.clone(), vec![Complex::ZERO; plan.bins()]);
    group.bench_function("f_test", |b| {
        b.iter(|| plan.f_test_into(black_box(&x), &mut scratch, &mut f, &mut amplitude));
    });
    group.bench_function("seven_tapers", |b| {
        b.iter(|| Slepian::new(black_box(SAMPLES), 4.0, 7));
    });
    group.finish();
}

fn lomb_scargle(c: &mut Criterion) {
    let (samples, bins) = (4096_u32, 1024);
    let t_s: Vec<f64> = (0..samples)
        .map(|n| f64::from(n) + 0.1 * f64::from(n % 7))
        .collect();
    let x = series(4096);
    let settings = LombScargleSettings {
        first_hz: 1e-4,
        step_hz: 4e-4,
        bins,
        floating_mean: true,
        fs_hz: 1.0,
    };
    let plan = LombScargle::new(&t_s, settings.clone()).expect("plan");
    let (mut scratch, mut psd) = (plan.make_scratch(), vec![0.0; bins]);
    let mut group = c.benchmark_group("lomb_scargle");
    // samples times bins
    group.throughput(Throughput::Elements(u64::from(samples) * bins as u64));
    group.bench_function("1024_bins", |b| {
        b.iter(|| plan.process_into(black_box(&x), &mut scratch, &mut psd));
    });
    group.bench_function("plan_of_1024_bins", |b| {
        b.iter(|| LombScargle::new(black_box(&t_s), settings.clone()));
    });
    group.finish();
}

fn allan(c: &mut Criterion) {
    let x = series(SAMPLES);
    let plan = Allan::new(
        AllanData::Rate,
        AllanKind::Overlapping,
        PowerLaw::WhiteRate,
        1.0,
    )
    .expect("plan");
    let factors = plan.octaves(SAMPLES);
    let mut scratch = plan.make_scratch(SAMPLES);
    let mut deviation = vec![0.0; factors.len()];
    let mut group = c.benchmark_group("allan");
    group.throughput(Throughput::Elements(SAMPLES as u64));
    group.bench_function("octaves", |b| {
        b.iter(|| plan.process_into(black_box(&x), &factors, &mut scratch, &mut deviation));
    });
    group.finish();
}

criterion_group!(benches, welch, multitaper, lomb_scargle, allan);
criterion_main!(benches);
