//! A tracker whose windows have a known truth, and what the tests read off its report.
//!
//! Gaussian spots on integrating pixels, photon and read noise, pixels with a level
//! of their own; the table's centroids are plain first moments, and neither the
//! stars' directions nor the attitude are given.
//!
//! Source: integration of a Gaussian over square pixels (`centroid::pixel_gaussian_into`).

use std::collections::BTreeMap;

use closed_loop::{Closed, close};
use focal_plane::{Camera, Pixel, StarFrames};
use nalgebra::{UnitQuaternion, Vector3};
use rand_core::SeedableRng;
use rand_distr::{Distribution, Exp1, StandardNormal, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;
use telemetry::{Bundle, Model, WindowTable};

/// Warm pixels by column and row of the detector, counted from the boresight.
pub(crate) type Warm = BTreeMap<[i64; 2], f64>;
/// Where each star is while the tracker does not move, px.
pub(crate) type Field = [[f64; 2]; 5];

/// Focal length of a long camera: 5 arcsec a pixel.
pub(crate) const FOCAL_PX: f64 = 41_252.96;
pub(crate) const BACKGROUND: f64 = 20.0;
/// Variance of a pixel that holds `s` units: `READ^2 + s/GAIN`.
pub(crate) const READ: f64 = 4.0;
pub(crate) const GAIN: f64 = 5.0;
pub(crate) const WIDE: Field = [
    [97.6, 50.3],
    [114.4, 52.9],
    [-210.2, 205.7],
    [-160.9, -190.4],
    [233.3, -120.8],
];

/// What to make.
pub(crate) struct Scene {
    pub(crate) frames: usize,
    pub(crate) stars: Field,
    /// Stars used, from the first.
    pub(crate) count: usize,
    pub(crate) size: [usize; 2],
    pub(crate) unread: Vec<[usize; 2]>,
    pub(crate) sigma_px: f64,
    pub(crate) flux: f64,
    pub(crate) pixel_centre: f64,
    /// Shift along x and y, px, and roll, px at 1000 px, of frame `k` of `n`.
    pub(crate) motion: fn(usize, usize) -> [f64; 3],
    pub(crate) warm: Warm,
    /// Share of the pixels with a particle hit, hundreds of units each.
    pub(crate) hits: f64,
    pub(crate) seed: u64,
}

/// Twenty pixels from end to end along x, to and fro along y.
pub(crate) fn drift(k: usize, n: usize) -> [f64; 3] {
    let s = k as f64 / (n - 1) as f64;
    let t = k as f64;
    [
        -9.0 + 18.0 * s + 0.4 * (0.37 * t).sin(),
        6.0 * (0.031 * t).sin() + 0.5 * (0.53 * t).cos(),
        0.0,
    ]
}

/// Twenty pixels to and fro, every place many times.
pub(crate) fn dither(k: usize, _: usize) -> [f64; 3] {
    let t = k as f64;
    [
        10.0 * (0.0297 * t).sin(),
        10.0 * (0.0419 * t).sin(),
        3.0 * (0.013 * t).sin(),
    ]
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            frames: 600,
            stars: WIDE,
            count: 5,
            size: [6, 6],
            unread: Vec::new(),
            sigma_px: 0.75,
            flux: 6000.0,
            pixel_centre: 0.5,
            motion: dither,
            warm: Warm::new(),
            hits: 0.0,
            seed: 1,
        }
    }
}

impl Scene {
    pub(crate) fn make(&self) -> Bundle {
        let camera = Camera::from_focal_length_px([1024, 1024], FOCAL_PX)
            .and_then(|c| c.with_pixel_centre(self.pixel_centre))
            .unwrap();
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(self.seed);
        // of its own, so that the noise is the same with and without hits
        let mut particles = Xoshiro256PlusPlus::seed_from_u64(!self.seed);
        let [columns, rows] = self.size;
        let mut images = WindowTable {
            size: self.size,
            unread: vec![false; columns * rows],
            ..WindowTable::default()
        };
        for &[row, column] in &self.unread {
            images.unread[row * columns + column] = true;
        }
        let mut stars = StarFrames::new();
        let mut spot = vec![0.0; columns * rows];
        for k in 0..self.frames {
            let [x, y, roll] = (self.motion)(k, self.frames);
            // small rotation: dx = f theta_y, dy = -f theta_x
            let theta = Vector3::new(-y / FOCAL_PX, x / FOCAL_PX, roll / 1000.0);
            let q = UnitQuaternion::from_scaled_axis(theta);
            let t_s = 2.0 * k as f64;
            stars.begin(t_s);
            for (i, star) in self.stars.iter().take(self.count).enumerate() {
                let at = camera
                    .project(
                        &(q * camera.direction(Pixel {
                            x: star[0],
                            y: star[1],
                        })),
                    )
                    .unwrap();
                let corner = self.corner(at);
                let flux = self.flux * (1.0 - 0.12 * i as f64);
                let first = Pixel {
                    x: corner[0] as f64 + self.pixel_centre,
                    y: corner[1] as f64 + self.pixel_centre,
                };
                centroid::pixel_gaussian_into(first, columns, at, self.sigma_px, flux, &mut spot)
                    .unwrap();
                let mut sum = [0.0; 3];
                for (p, light) in spot.iter().enumerate() {
                    let (c, r) = (p % columns, p / columns);
                    let key = [
                        corner[0] + i64::try_from(c).unwrap(),
                        corner[1] + i64::try_from(r).unwrap(),
                    ];
                    let signal = light + BACKGROUND + self.warm.get(&key).unwrap_or(&0.0);
                    let e: f64 = StandardNormal.sample(&mut rng);
                    let mut value = signal + (READ * READ + signal / GAIN).sqrt() * e;
                    let u: f64 = StandardUniform.sample(&mut particles);
                    if u < self.hits {
                        let e: f64 = Exp1.sample(&mut particles);
                        value += 300.0 * (1.0 + e);
                    }
                    if images.unread[p] {
                        value = 0.0;
                    } else {
                        let q = value - BACKGROUND;
                        sum = [sum[0] + q, sum[1] + q * c as f64, sum[2] + q * r as f64];
                    }
                    images.pixels.push(value);
                }
                let slot = i32::try_from(i).unwrap();
                let place = [first.x + sum[1] / sum[0], first.y + sum[2] / sum[0]];
                stars.push(slot, 1000 + i64::from(slot), place[0], place[1]);
                images.t_s.push(t_s);
                images.slot.push(slot);
                images.x0_px.push(first.x);
                images.y0_px.push(first.y);
                images.background.push(BACKGROUND);
            }
        }
        Bundle {
            camera: Some(camera),
            stars: Some(stars),
            images: Some(images),
            ..Bundle::default()
        }
    }

    /// Column and row of the first pixel of the window around a star.
    #[expect(clippy::cast_possible_truncation, reason = "a thousand pixels")]
    fn corner(&self, at: Pixel) -> [i64; 2] {
        let first =
            |v: f64, n: usize| (v - self.pixel_centre - 0.5 * (n as f64 - 1.0)).round() as i64;
        [first(at.x, self.size[0]), first(at.y, self.size[1])]
    }
}

pub(crate) fn run(bundle: &Bundle) -> Closed {
    close(&Model::default(), bundle, &|_| ()).unwrap()
}

/// A share of all pixels around the stars, exponential with this mean.
pub(crate) fn population(share: f64, mean: f64, stars: &Field, seed: u64) -> Warm {
    let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
    let mut warm = Warm::new();
    for star in stars {
        #[expect(clippy::cast_possible_truncation, reason = "a thousand pixels")]
        let centre = [star[0] as i64, star[1] as i64];
        for x in -16..=16 {
            for y in -16..=16 {
                let (u, e): (f64, f64) = (StandardUniform.sample(&mut rng), Exp1.sample(&mut rng));
                if u < share {
                    warm.entry([centre[0] + x, centre[1] + y])
                        .or_insert(mean * e);
                }
            }
        }
    }
    warm
}

pub(crate) fn rms(closed: &Closed) -> [[f64; 2]; 2] {
    [&closed.report.before, &closed.report.after].map(|e| e.star_rms_arcsec.unwrap())
}

pub(crate) fn ids(closed: &Closed) -> Vec<&str> {
    closed
        .report
        .effects
        .iter()
        .map(|e| e.id.as_str())
        .collect()
}

/// The bundle without the rows of both tables that `keep` refuses, by time and slot.
pub(crate) fn keep_rows(
    bundle: &Bundle,
    stars: impl Fn(f64, i32) -> bool,
    windows: impl Fn(f64, i32) -> bool,
) -> Bundle {
    let all = bundle.stars.as_ref().unwrap();
    let mut frames = StarFrames::new();
    for k in 0..all.frames() {
        frames.begin(all.t_s[k]);
        for row in all
            .rows_of(k)
            .filter(|&row| stars(all.t_s[k], all.slot[row]))
        {
            frames.push(
                all.slot[row],
                all.star_id[row],
                all.x_px[row],
                all.y_px[row],
            );
        }
    }
    let all = bundle.images.as_ref().unwrap();
    let mut images = WindowTable {
        size: all.size,
        unread: all.unread.clone(),
        ..WindowTable::default()
    };
    for i in (0..all.len()).filter(|&i| windows(all.t_s[i], all.slot[i])) {
        images.t_s.push(all.t_s[i]);
        images.slot.push(all.slot[i]);
        images.x0_px.push(all.x0_px[i]);
        images.y0_px.push(all.y0_px[i]);
        images.background.push(all.background[i]);
        images.pixels.extend_from_slice(all.window(i));
    }
    Bundle {
        stars: Some(frames),
        images: Some(images),
        ..bundle.clone()
    }
}
