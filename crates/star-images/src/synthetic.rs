//! Windows of a made-up tracker with a known truth, for the tests.
//!
//! Gaussian spots on integrating pixels, noise `a + b signal`, detector pixels with
//! values of their own, and the table's centroids as plain first moments.
//!
//! Source: integration of a Gaussian over square pixels (`centroid::pixel_gaussian_into`).

use focal_plane::{Camera, Pixel, StarFrames};
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use telemetry::WindowTable;

use super::Stars;
use super::sample::{Entry, Sample};

/// What to make.
pub(crate) struct Scenario<'a> {
    pub(crate) frames: usize,
    /// Position of each star in frame 0, px.
    pub(crate) stars: &'a [[f64; 2]],
    /// Shift of all stars in a frame, px.
    pub(crate) motion: &'a dyn Fn(usize) -> [f64; 2],
    /// Shift of one star in a frame along x, px.
    pub(crate) wander: &'a dyn Fn(usize, usize) -> f64,
    /// What the pixel with this centre adds.
    pub(crate) dark: &'a dyn Fn([f64; 2]) -> f64,
    /// What it adds beside that in a frame.
    pub(crate) switching: &'a dyn Fn(usize, [f64; 2]) -> f64,
    /// Windows (row index) with a particle hit.
    pub(crate) hit: &'a dyn Fn(usize) -> bool,
    /// Whether the image of a star in a frame is in the bundle.
    pub(crate) kept: &'a dyn Fn(usize, usize) -> bool,
    pub(crate) size: usize,
    pub(crate) pixel_centre: f64,
    pub(crate) seed: u64,
}

pub(crate) const FLUX: f64 = 10_000.0;
pub(crate) const SIGMA_PX: f64 = 1.0;
pub(crate) const BACKGROUND: f64 = 30.0;
pub(crate) const NOISE: [f64; 2] = [4.0, 0.25];

pub(crate) fn nothing(_: [f64; 2]) -> f64 {
    0.0
}

pub(crate) fn steady(_: usize, _: [f64; 2]) -> f64 {
    0.0
}

pub(crate) fn rigid(_: usize, _: usize) -> f64 {
    0.0
}

pub(crate) fn no_hit(_: usize) -> bool {
    false
}

pub(crate) fn all(_: usize, _: usize) -> bool {
    true
}

/// A slow dither, px.
pub(crate) fn dither(k: usize) -> [f64; 2] {
    let t = k as f64;
    [
        3.0 * (t * 0.0317).sin() + 0.8 * (t * 0.211).sin(),
        2.6 * (t * 0.0233).cos() + 0.7 * (t * 0.173).cos(),
    ]
}

/// Star rows, and where a model without catalogue or reference puts them.
pub(crate) struct Data {
    pub(crate) camera: Camera,
    pub(crate) frames: StarFrames,
    pub(crate) stars: usize,
    pub(crate) star: Vec<usize>,
    expected_px: [Vec<f64>; 2],
}

impl Data {
    /// A place of each star and a shift of each frame, by alternating means of the centroids.
    pub(crate) fn new(camera: Camera, frames: StarFrames) -> Self {
        let mut ids: Vec<i64> = frames.star_id.clone();
        ids.sort_unstable();
        ids.dedup();
        let star: Vec<usize> = frames
            .star_id
            .iter()
            .map(|id| ids.binary_search(id).unwrap())
            .collect();
        let frame: Vec<usize> = (0..frames.frames())
            .flat_map(|k| frames.rows_of(k).map(move |_| k))
            .collect();
        let expected_px = [&frames.x_px, &frames.y_px].map(|at| {
            let mut shift = vec![0.0; frames.frames()];
            let mut place = vec![0.0; ids.len()];
            for _ in 0..50 {
                place = means(&star, place.len(), |row| at[row] - shift[frame[row]]);
                shift = means(&frame, shift.len(), |row| at[row] - place[star[row]]);
            }
            let rows = star.iter().zip(&frame);
            rows.map(|(&s, &k)| place[s] + shift[k]).collect()
        });
        Self {
            camera,
            frames,
            stars: ids.len(),
            star,
            expected_px,
        }
    }

    pub(crate) fn stars(&self) -> Stars<'_> {
        Stars {
            camera: &self.camera,
            frames: &self.frames,
            stars: self.stars,
            star: &self.star,
            expected_px: self.expected_px.each_ref().map(Vec::as_slice),
        }
    }
}

/// The mean of the rows of each of so many groups.
fn means(group: &[usize], groups: usize, value: impl Fn(usize) -> f64) -> Vec<f64> {
    let mut sums = vec![[0.0; 2]; groups];
    for (row, &g) in group.iter().enumerate() {
        sums[g] = [sums[g][0] + value(row), sums[g][1] + 1.0];
    }
    sums.into_iter().map(|[sum, n]| sum / n).collect()
}

/// Stars and windows, and the true positions of the rows.
pub(crate) struct Made {
    pub(crate) data: Data,
    pub(crate) windows: WindowTable,
    pub(crate) truth: [Vec<f64>; 2],
}

impl Scenario<'_> {
    pub(crate) fn make(&self) -> Made {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        let mut windows = WindowTable {
            size: [self.size; 2],
            unread: vec![false; self.size * self.size],
            ..WindowTable::default()
        };
        let mut frames = StarFrames::new();
        let mut truth = [Vec::new(), Vec::new()];
        let mut flux = Vec::new();
        let mut spot = vec![0.0; self.size * self.size];
        for k in 0..self.frames {
            let shift = (self.motion)(k);
            let t_s = k as f64;
            for (s, star) in self.stars.iter().enumerate() {
                let row = truth[0].len();
                let at = [star[0] + shift[0] + (self.wander)(k, s), star[1] + shift[1]];
                let half = (self.size as f64 - 1.0) / 2.0;
                let corner = at.map(|v| (v - half - self.pixel_centre).round() + self.pixel_centre);
                let (first, place) = (
                    Pixel {
                        x: corner[0],
                        y: corner[1],
                    },
                    Pixel { x: at[0], y: at[1] },
                );
                let brightness = FLUX * (1.0 - 0.15 * s as f64);
                centroid::pixel_gaussian_into(
                    first, self.size, place, SIGMA_PX, brightness, &mut spot,
                )
                .unwrap();
                let mut values = Vec::new();
                for (i, light) in spot.iter().enumerate() {
                    let centre = [
                        corner[0] + (i % self.size) as f64,
                        corner[1] + (i / self.size) as f64,
                    ];
                    let own = (self.dark)(centre) + (self.switching)(k, centre);
                    let signal = light + BACKGROUND + own;
                    let e: f64 = StandardNormal.sample(&mut rng);
                    values.push(signal + (NOISE[0] + NOISE[1] * signal.max(0.0)).sqrt() * e);
                }
                if (self.hit)(row) {
                    values[(row * 7) % (self.size * self.size)] += 3000.0;
                }
                let sums = values.iter().enumerate().fold([0.0; 3], |m, (i, v)| {
                    let q = v - BACKGROUND;
                    let (c, r) = ((i % self.size) as f64, (i / self.size) as f64);
                    [m[0] + q, m[1] + q * c, m[2] + q * r]
                });
                frames.slot.push(i32::try_from(s).unwrap());
                frames.star_id.push(i64::try_from(s).unwrap() + 100);
                frames.x_px.push(corner[0] + sums[1] / sums[0]);
                frames.y_px.push(corner[1] + sums[2] / sums[0]);
                flux.push(sums[0]);
                truth[0].push(at[0]);
                truth[1].push(at[1]);
                if (self.kept)(k, s) {
                    windows.t_s.push(t_s);
                    windows.slot.push(i32::try_from(s).unwrap());
                    windows.x0_px.push(corner[0]);
                    windows.y0_px.push(corner[1]);
                    windows.background.push(BACKGROUND);
                    windows.pixels.extend(values);
                }
            }
            frames.t_s.push(t_s);
            frames.first_row.push(frames.slot.len());
        }
        frames.flux = Some(flux);
        let camera = Camera::from_focal_length_px([1024, 1024], 40_000.0)
            .unwrap()
            .with_pixel_centre(self.pixel_centre)
            .unwrap();
        let data = Data::new(camera, frames);
        Made {
            data,
            windows,
            truth,
        }
    }
}

/// Windows of one star, 4 by 4 pixels, without noise, for tests of single steps.
pub(crate) fn few_windows(count: usize) -> Sample {
    let mut values = Vec::new();
    let mut place = Vec::new();
    for k in 0..count {
        let [dx, dy] = dither(17 * k).map(|v| 0.5 * v);
        let at = Pixel {
            x: 40.0 + dx,
            y: -25.0 + dy,
        };
        let corner = [(at.x - 1.5).round(), (at.y - 1.5).round()];
        let mut window = vec![0.0; 16];
        let first = Pixel {
            x: corner[0],
            y: corner[1],
        };
        centroid::pixel_gaussian_into(first, 4, at, 0.9, FLUX, &mut window).unwrap();
        for v in &mut window {
            *v += BACKGROUND;
        }
        values.push(window);
        place.push((at, corner));
    }
    let frames: Vec<Vec<Entry<'_>>> = place
        .iter()
        .zip(&values)
        .enumerate()
        .map(|(row, (&(at, corner), values))| {
            vec![Entry {
                row,
                t_s: row as f64,
                star: 0,
                start: [at.x, at.y],
                flux: Some(FLUX),
                base: [at.x, at.y],
                jacobian: [[0.0, 4e4, 25.0], [-4e4, 0.0, 40.0]],
                corner,
                background: BACKGROUND,
                values,
            }]
        })
        .collect();
    Sample::collect(1, [4, 4], &[], &frames).unwrap()
}

/// Root mean square over both axes of `at - truth` for the rows `taken`, each
/// star's and axis's mean taken off: a constant offset is a matter of definition.
pub(crate) fn rms(made: &Made, at: &[Vec<f64>; 2], taken: &dyn Fn(usize) -> bool) -> f64 {
    let stars = made.data.stars;
    let (mut total, mut count) = (0.0, 0.0);
    for axis in 0..2 {
        for s in 0..stars {
            let all: Vec<f64> = (0..made.truth[0].len())
                .filter(|&r| made.data.star[r] == s)
                .map(|r| at[axis][r] - made.truth[axis][r])
                .collect();
            let centre = super::robust::robust_median(all).unwrap();
            for r in (0..made.truth[0].len()).filter(|&r| made.data.star[r] == s && taken(r)) {
                total += (at[axis][r] - made.truth[axis][r] - centre).powi(2);
                count += 1.0;
            }
        }
    }
    f64::sqrt(total / count)
}
