//! Whole frames of the PBM: 14 stars, order 7, triangle, noise, QUEST. The batch against a
//! straightforward program that takes one star after another.

use std::hint::black_box;

use centroid::{CentroidError, Triangle};
use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use distortion::{DistortionField, LsfSigma};
use focal_plane::{Angle, AttitudeSource, Camera, PointsMut, UniformRotation, Vectors};
use nalgebra::{UnitQuaternion, Vector3};
use rand_distr::{Distribution, StandardNormal};
use star_tracker::{
    Measured, NoiseStreams, Pbm, Purpose, Rows, Scratch, StarField, TemporalNoise, stream,
};

const STARS: usize = 14;

struct Frames {
    t_s: Vec<f64>,
    first_row: Vec<usize>,
    u: [Vec<f64>; 3],
    stars: Vec<Vector3<f64>>,
}

impl Frames {
    fn new(camera: &Camera, frames: usize) -> Self {
        let mut rng = stream(1, 0, Purpose::StarField);
        let identity = UnitQuaternion::identity();
        let field = StarField::generate(camera, &identity, STARS, &mut rng).expect("14 stars");
        let stars: Vec<Vector3<f64>> = field.stars().iter().map(|star| star.direction).collect();
        let u = [0, 1, 2].map(|a| {
            (0..frames)
                .flat_map(|_| stars.iter().map(move |s| s[a]))
                .collect()
        });
        Self {
            t_s: (0..frames).map(|k| 0.1 * k as f64).collect(),
            first_row: (0..=frames).map(|k| k * STARS).collect(),
            u,
            stars,
        }
    }

    fn rows(&self) -> Rows<'_> {
        Rows {
            t_s: &self.t_s,
            first_row: &self.first_row,
            slot: &[],
            star_id: &[],
            mag: &[],
            bv: &[],
            direction: Vectors {
                x: &self.u[0],
                y: &self.u[1],
                z: &self.u[2],
            },
        }
    }
}

fn model(camera: &Camera) -> Pbm {
    let mut rng = stream(1, 0, Purpose::Distortion);
    let size = LsfSigma::Circular(Angle::from_arcsec(3.1667));
    Pbm::new(camera.clone())
        .with_distortion(DistortionField::draw(7, size, &mut rng).expect("order 7"))
        .with_centroid_error(CentroidError::Triangle(Triangle::from_peak(5.06)))
        .with_noise(TemporalNoise::circular_arcsec(7.43).expect("positive"))
}

/// Eq. 4 to 14 as one would write them down: powers, double sum, asin(sin), one star at a time.
fn one_star_at_a_time(
    camera: &Camera,
    pbm: &Pbm,
    truth: &UniformRotation,
    frames: &Frames,
    rng: &mut NoiseStreams,
) -> Vec<UnitQuaternion<f64>> {
    let (field, scale, half) = (
        pbm.distortion(),
        camera.arcsec_per_px(),
        camera.half_size_px(),
    );
    let sigma = pbm.noise().base_arcsec();
    let weights = [1.0; STARS];
    frames
        .t_s
        .iter()
        .map(|&t_s| {
            let q = truth.attitude(t_s).expect("any time");
            let mut w = [Vector3::zeros(); STARS];
            for (w, u) in w.iter_mut().zip(&frames.stars) {
                let at = camera.project(&(q * u)).expect("in front");
                let (mut dx, mut dy) = (0.0, 0.0);
                let (x, y) = (at.x / half[0], at.y / half[1]);
                let mut y_power = 1.0;
                for j in 0..8 {
                    let mut power = y_power;
                    for k in 0..8 {
                        dx += field.a()[8 * j + k] * power;
                        dy += field.b()[8 * j + k] * power;
                        power *= x;
                    }
                    y_power *= y;
                }
                let mut seen = at;
                seen.x += dx / scale[0];
                seen.y += dy / scale[1];
                let triangle =
                    |p: f64| 5.06 * core::f64::consts::FRAC_2_PI * camera.phase_rad(p).sin().asin();
                let (cx, cy) = (triangle(seen.x), triangle(seen.y));
                let nx: f64 = StandardNormal.sample(&mut rng.noise);
                let ny: f64 = StandardNormal.sample(&mut rng.noise);
                seen.x += (cx + sigma * nx) / scale[0];
                seen.y += (cy + sigma * ny) / scale[1];
                *w = camera.direction(seen);
            }
            quest::quest(&w, &frames.stars, &weights)
                .expect("spread stars")
                .q
        })
        .collect()
}

fn frame(c: &mut Criterion) {
    let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).expect("a camera");
    let truth = UniformRotation {
        rate_rad_s: Vector3::new(1e-5, -2e-5, 1e-6),
        ..Default::default()
    };
    let pbm = model(&camera);
    let mut group = c.benchmark_group("pbm_frame");
    for frames in [1_usize, 64, 1024] {
        let input = Frames::new(&camera, frames);
        group.throughput(Throughput::Elements(frames as u64));
        let (mut scratch, mut out) = (Scratch::default(), Measured::default());
        let mut streams = NoiseStreams::new(1, 0);
        group.bench_function(BenchmarkId::new("batch", frames), |b| {
            b.iter(|| {
                let rows = black_box(&input).rows();
                pbm.measure_into(&truth, rows, &mut streams, &mut scratch, &mut out);
                out.qx[0]
            });
        });
        let (mut x, mut y) = (vec![0.0; STARS * frames], vec![0.0; STARS * frames]);
        group.bench_function(BenchmarkId::new("batch_positions_only", frames), |b| {
            b.iter(|| {
                let out = PointsMut {
                    x: &mut x,
                    y: &mut y,
                };
                pbm.positions_into(&truth, black_box(&input).rows(), &mut scratch, out)
            });
        });
        group.bench_function(BenchmarkId::new("one_star_at_a_time", frames), |b| {
            b.iter(|| one_star_at_a_time(&camera, &pbm, &truth, black_box(&input), &mut streams));
        });
    }
    group.finish();
}

criterion_group!(benches, frame);
criterion_main!(benches);
