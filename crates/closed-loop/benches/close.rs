//! The whole loop on runs of 5 and 30 min, 14 stars at 2 Hz, with and without an effect; per star row.
//!
//! `cargo bench -p closed-loop`

use std::hint::black_box;

use closed_loop::close;
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use scenarios::{Scenario, simulate};

const RUN: &str = r#"
format = "boresight-model/1"
kind = "pbm"
[tracker]
pixels = [1024, 1024]
fov_deg = [20.0, 20.0]
max_stars = 14
[noise]
temporal_arcsec = 7.43
centroid_arcsec = 5.06
distortion_arcsec = 3.1667
distortion_order = 7
[reference]
[sky]
kind = "hipparcos"
stars = 14
[motion]
kind = "slews"
start = { ra_deg = 75.0, dec_deg = 20.0, roll_deg = 20.0 }
drift_arcsec_s = [1.5, -2.5, 0.5]
wait_s = 20.0
repeat = 20
[[motion.slew]]
axis = [1.0, 0.0, 0.0]
angle_deg = 1.3
duration_s = 30.0
hold_s = 10.0
[[motion.slew]]
axis = [1.0, 0.0, 0.0]
angle_deg = -1.3
duration_s = 30.0
hold_s = 10.0
"#;
const SHUTTER: &str = "[[effect]]\nid = \"rolling_shutter\"\nline_time_s = 1.0e-5\n";

fn loops(c: &mut Criterion) {
    let mut group = c.benchmark_group("close");
    group.sample_size(10);
    for minutes in [5, 30] {
        for (what, effect) in [("null", ""), ("rolling_shutter", SHUTTER)] {
            let duration_s = 60 * minutes;
            let run = format!("[run]\nduration_s = {duration_s}\nrate_hz = 2.0\nseed = 5\n");
            let scenario = Scenario::parse(&format!("{RUN}{run}{effect}"), "bench.toml")
                .expect("a scenario that is right");
            let bundle = simulate(&scenario).expect("a run");
            let model = scenario.model_without_effects();
            let rows = bundle.stars.as_ref().map_or(0, |s| s.rows());
            group.throughput(Throughput::Elements(rows as u64));
            group.bench_function(BenchmarkId::new(what, format!("{minutes}_min")), |b| {
                b.iter(|| close(black_box(&model), black_box(&bundle), &|_| ()));
            });
        }
    }
    group.finish();
}

criterion_group!(benches, loops);
criterion_main!(benches);
