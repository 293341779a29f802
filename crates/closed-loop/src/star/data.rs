//! Star measurements beside what the declared model says of them.
//!
//! For every row: the projected position of the star (reference attitude or the
//! frame's own, catalogue direction or the solved one), its velocity and
//! acceleration across the detector, and the declared pixel-phase error. The
//! residual is
//!
//! ```text
//! r = (measured - projected - declared centroid error) * arcsec per pixel
//! ```
//!
//! All regressors are evaluated at the *modelled* position, projection +
//! misalignment + distortion and, where stars rest, what they tell of the reference's
//! error, never at the measured one: regressing on measured positions explains noise by shrinking
//! everything, and the triangle evaluated at the raw projection raises false alarms.
//! The modelled position is improved once the first fit has given misalignment and
//! distortion ([`crate::star::landing`]).
//!
//! Source: [M23] Fig. 4 for the order of the terms.

use std::collections::HashMap;
use std::ops::Range;
use std::sync::Arc;

use effects::{Effect, PixelWaves, StarRows};
use focal_plane::{AttitudeSeries, AttitudeSource, Camera, Pixel, Points, PointsMut, StarFrames};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use rayon::prelude::*;
use star_tracker::StarView;
use telemetry::WindowTable;

use spectra::robust;

use crate::declared::OnCentroids;
use crate::motion;
use crate::star::directions;

/// A star that moves by less of the detector's width than this is where it was, to
/// a declared distortion of the usual order.
const NEAR_SHARE: f64 = 1.0 / 16.0;
/// A star that moves by fewer times what its reference puts it off by is at rest.
const RESTS: f64 = 100.0;
/// Frames with a smaller share of stars that stayed are unrelated.
const SAME_SHARE: f64 = 0.1;
/// Rows of which a run is long.
const LONG_ROWS: usize = 300_000;
/// Rows whose centroid errors one thread evaluates.
const TOGETHER: usize = 4096;

/// What is known of one star.
#[derive(Clone, Debug)]
pub(crate) struct Star {
    pub(crate) id: i64,
    /// Magnitude and colour; NaN where unknown.
    pub(crate) mag: f64,
    pub(crate) bv: f64,
    /// Unit vector, inertial, at the bundle's epoch.
    pub(crate) direction: Vector3<f64>,
}

/// By how much the reference puts each row off, as the stars tell it, and how well that is known.
#[derive(Clone, Debug)]
pub(crate) struct Light {
    pub(crate) beside_px: [Vec<f64>; 2],
    pub(crate) variance_px2: [Vec<f64>; 2],
}

impl Light {
    pub(super) fn beside(&self, from: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
        std::array::from_fn(|axis| {
            let beside = self.beside_px[axis].iter();
            from[axis].iter().zip(beside).map(|(p, b)| p + b).collect()
        })
    }

    /// Whether it is off anywhere.
    fn is_beside(&self) -> bool {
        self.beside_px.iter().flatten().any(|&off| off != 0.0)
    }

    /// Where the reference has it.
    pub(crate) fn as_modelled(rows: usize) -> Self {
        let zeros = || [vec![0.0; rows], vec![0.0; rows]];
        Self {
            beside_px: zeros(),
            variance_px2: zeros(),
        }
    }
}

/// Rows of star measurements, structure of arrays, frames contiguous.
#[derive(Clone, Debug)]
pub(crate) struct StarData {
    pub(crate) camera: Camera,
    /// The measurements (times, ids, slots, centroids); rows outside the
    /// reference are already gone.
    pub(crate) frames: StarFrames,
    pub(crate) stars: Vec<Star>,
    /// Index into `stars`, a row.
    pub(crate) star: Vec<usize>,
    /// Time of the frame, a row, s.
    pub(crate) t_s: Vec<f64>,
    /// Magnitude and colour, a row.
    pub(crate) mag: Vec<f64>,
    pub(crate) bv: Vec<f64>,
    /// Usual flux of the star, a row, as a logarithm to base 10; NaN where unknown. That of
    /// the row shares its noise with the centroid.
    pub(crate) log_flux: Vec<f64>,
    /// The row's own over that: of photons alone, noise.
    pub(crate) log_flux_change: Vec<f64>,
    /// Middle of the window, a row, px; NaN where unknown, empty without windows.
    pub(crate) window_px: [Vec<f64>; 2],
    /// Misalignment between reference and camera that the attitudes hold already, arcsec
    /// ([`crate::star::misalignment`]).
    pub(crate) misalignment: Vector3<f64>,
    /// Attitude of each frame.
    pub(crate) attitude: Vec<UnitQuaternion<f64>>,
    /// What turns the frames of a star back, in the mean; empty unless directions are unknown beside a
    /// reference ([`crate::star::seen_directions`]).
    pub(super) turned_back: Vec<Matrix3<f64>>,
    /// Projected position, px.
    pub(crate) projected: [Vec<f64>; 2],
    /// Modelled position, px: where regressors are evaluated.
    pub(crate) modelled: [Vec<f64>; 2],
    /// How far the reference puts them off, [`crate::star::light`].
    pub(super) light: Light,
    /// Where the light falls, as far as is known, px; `None`: where it is modelled.
    landed: Option<[Vec<f64>; 2]>,
    /// Axes along which it is not known to move.
    still: [bool; 2],
    /// Velocity and acceleration of the image, px/s and px/s^2; zero where the
    /// motion is not known.
    pub(crate) velocity: [Vec<f64>; 2],
    pub(crate) acceleration: [Vec<f64>; 2],
    /// What the declared model does to centroids where the light falls, px.
    pub(crate) phase_error: [Vec<f64>; 2],
    /// Rows left out of every fit and figure.
    pub(crate) outlier: Vec<bool>,
    /// No reference: every frame's attitude is an unknown of its own.
    pub(crate) free_attitude: bool,
    /// No catalogue: every star's direction is an unknown constant.
    pub(crate) free_directions: bool,
    /// Star rows that had to be set aside because the reference does not cover them, or not enough of
    /// the time around them.
    pub(crate) outside_reference: usize,
    /// Those of them that are rows here, among the outliers.
    pub(crate) unplaced: usize,
    /// Rows among the outliers that are none, but whose centroids could not be formed anew.
    pub(crate) unformed: usize,
}

/// What [`StarData::prepare`] starts from.
pub(crate) struct Inputs<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) frames: &'a StarFrames,
    pub(crate) reference: Option<&'a AttitudeSeries>,
    /// Direction, magnitude and colour by star id, if there is a catalogue.
    pub(crate) catalogue: Option<&'a dyn Fn(i64) -> Option<Star>>,
    pub(crate) phase: &'a OnCentroids,
    /// Effects that the model declares: what they do before the centroid moves the projection.
    pub(crate) effects: &'a [Arc<dyn Effect>],
}

impl StarData {
    /// Joins measurements, reference and catalogue. Frames outside the reference, frames without a
    /// solvable attitude, and the few around which the motion is not known though it is elsewhere, are
    /// set aside.
    pub(crate) fn prepare(inputs: &Inputs<'_>) -> Self {
        let mut stars: Vec<Star> = Vec::new();
        let mut index_of = std::collections::BTreeMap::new();
        let mut star = Vec::with_capacity(inputs.frames.rows());
        for (row, &id) in inputs.frames.star_id.iter().enumerate() {
            let index = *index_of.entry(id).or_insert_with(|| {
                let known = inputs.catalogue.and_then(|find| find(id));
                let mag = inputs.frames.mag.as_ref().map_or(f64::NAN, |m| m[row]);
                stars.push(known.unwrap_or(Star {
                    id,
                    mag,
                    bv: f64::NAN,
                    direction: Vector3::zeros(),
                }));
                stars.len() - 1
            });
            star.push(index);
        }
        let free_directions = inputs.catalogue.is_none();
        let (mut attitude, free_attitude) = Self::solve(inputs, &star, &mut stars, free_directions);
        set_aside_lost(inputs, &mut attitude);
        let mut data = Self::keep(inputs, &star, stars, &attitude);
        data.free_attitude = free_attitude;
        data.free_directions = free_directions;
        data.take_directions();
        let own = inputs
            .reference
            .is_none()
            .then(|| data.own_motion())
            .flatten();
        let motion = inputs.reference.or(own.as_ref());
        data.place(motion.map(|m| m as &dyn AttitudeSource), inputs.effects);
        let modelled = std::mem::take(&mut data.modelled);
        data.fall_at(modelled, None, inputs.phase);
        [data.log_flux, data.log_flux_change] = data.fluxes();
        data.frames.flux = None;
        data
    }

    /// Whether each frame is a picture of its own: its attitude is free, and hardly a
    /// star is where it was in the frame before. Then nothing that changes slowly over
    /// the detector or with time makes the noise of neighbouring frames alike.
    pub(crate) fn frames_are_unrelated(&self) -> bool {
        if !self.free_attitude {
            return false;
        }
        let near = NEAR_SHARE * 2.0 * self.camera.half_size_px()[0];
        let (mut same, mut all) = (0_usize, 0_usize);
        let mut last = vec![[f64::INFINITY; 2]; self.stars.len()];
        for frame in 0..self.frames.frames() {
            let rows = self.frames.rows_of(frame);
            if frame > 0 {
                all += rows.len();
                let here = |&r: &usize| [self.modelled[0][r], self.modelled[1][r]];
                same += rows
                    .clone()
                    .filter(|r| {
                        let ([x, y], [u, v]) = (here(r), last[self.star[*r]]);
                        (x - u).hypot(y - v) < near
                    })
                    .count();
            }
            last.fill([f64::INFINITY; 2]);
            for r in rows {
                last[self.star[r]] = [self.modelled[0][r], self.modelled[1][r]];
            }
        }
        (same as f64) < SAME_SHARE * all as f64
    }

    /// Measured fluxes, see [`log_flux`](Self::log_flux), and by how much each is more.
    fn fluxes(&self) -> [Vec<f64>; 2] {
        let unknown = || vec![f64::NAN; self.t_s.len()];
        let Some(flux) = &self.frames.flux else {
            return [unknown(), unknown()];
        };
        let known = |flux: &f64| Some(flux.log10()).filter(|f| f.is_finite());
        let mut of_star = vec![Vec::new(); self.stars.len()];
        for (&star, flux) in self.star.iter().zip(flux) {
            of_star[star].extend(known(flux));
        }
        let usual: Vec<f64> = of_star
            .iter_mut()
            .map(|own| robust::median(own).unwrap_or(f64::NAN))
            .collect();
        let usual: Vec<f64> = self.star.iter().map(|&star| usual[star]).collect();
        let change = flux.iter().zip(&usual);
        let change = change.map(|(flux, usual)| known(flux).map_or(f64::NAN, |own| own - usual));
        let change = change.collect();
        [usual, change]
    }

    /// Takes the middles of the windows from their table.
    pub(crate) fn see_windows(&mut self, table: &WindowTable) {
        let half = table.size.map(|n| 0.5 * (n as f64 - 1.0));
        let at: HashMap<(u64, i32), usize> = (0..table.len())
            .map(|k| ((table.t_s[k].to_bits(), table.slot[k]), k))
            .collect();
        self.window_px = [0, 1].map(|_| vec![f64::NAN; self.t_s.len()]);
        for row in 0..self.t_s.len() {
            let key = (self.t_s[row].to_bits(), self.frames.slot[row]);
            if let Some(&k) = at.get(&key) {
                self.window_px[0][row] = table.x0_px[k] + half[0];
                self.window_px[1][row] = table.y0_px[k] + half[1];
            }
        }
    }

    /// Attitude of each frame, and directions where neither they nor the attitudes are known.
    fn solve(
        inputs: &Inputs<'_>,
        star: &[usize],
        stars: &mut [Star],
        free_directions: bool,
    ) -> (Vec<Option<UnitQuaternion<f64>>>, bool) {
        let (camera, frames) = (inputs.camera, inputs.frames);
        let Some(reference) = inputs.reference else {
            if free_directions {
                let solved = directions::solve(camera, frames, star, stars.len());
                for (s, u) in stars.iter_mut().zip(&solved.direction) {
                    s.direction = *u;
                }
                return (solved.attitude, true);
            }
            let known: Vec<_> = stars.iter().map(|s| Some(s.direction)).collect();
            return (directions::attitudes(camera, frames, star, &known), true);
        };
        let attitude: Vec<_> = frames.t_s.iter().map(|&t| reference.attitude(t)).collect();
        (attitude, false)
    }

    /// The rows whose frame has an attitude.
    fn keep(
        inputs: &Inputs<'_>,
        star: &[usize],
        stars: Vec<Star>,
        attitude: &[Option<UnitQuaternion<f64>>],
    ) -> Self {
        let from = inputs.frames;
        let mut rows = Vec::new();
        let mut frames = StarFrames::new();
        let mut kept_attitude = Vec::new();
        for (k, q) in attitude.iter().enumerate() {
            if let Some(q) = q {
                kept_attitude.push(*q);
                frames.t_s.push(from.t_s[k]);
                rows.extend(from.rows_of(k));
                frames.first_row.push(rows.len());
            }
        }
        let pick = |values: &[f64]| rows.iter().map(|&r| values[r]).collect::<Vec<f64>>();
        frames.slot = rows.iter().map(|&r| from.slot[r]).collect();
        frames.star_id = rows.iter().map(|&r| from.star_id[r]).collect();
        frames.x_px = pick(&from.x_px);
        frames.y_px = pick(&from.y_px);
        // only the usual flux of each star is asked for, see `fluxes`
        frames.flux = from.flux.as_ref().map(|m| pick(m));
        let star: Vec<usize> = rows.iter().map(|&r| star[r]).collect();
        let n = rows.len();
        let t_s = frames.t_of_rows_s();
        let pair = || [vec![0.0; n], vec![0.0; n]];
        Self {
            camera: inputs.camera.clone(),
            mag: star.iter().map(|&s| stars[s].mag).collect(),
            bv: star.iter().map(|&s| stars[s].bv).collect(),
            log_flux: vec![f64::NAN; n],
            log_flux_change: vec![f64::NAN; n],
            window_px: [Vec::new(), Vec::new()],
            outside_reference: from.rows() - n,
            unplaced: 0,
            unformed: 0,
            frames,
            stars,
            star,
            t_s,
            misalignment: Vector3::zeros(),
            attitude: kept_attitude,
            turned_back: Vec::new(),
            projected: pair(),
            modelled: pair(),
            light: Light::as_modelled(n),
            landed: None,
            still: [false; 2],
            velocity: pair(),
            acceleration: pair(),
            phase_error: pair(),
            outlier: vec![false; n],
            free_attitude: false,
            free_directions: false,
        }
    }

    /// Some frames of it.
    pub(crate) fn some_frames(&self, which: &[usize]) -> Self {
        let all = &self.frames;
        let rows: Vec<usize> = which.iter().flat_map(|&k| all.rows_of(k)).collect();
        let pick = |values: &[f64]| -> Vec<f64> { rows.iter().map(|&r| values[r]).collect() };
        let pair = |values: &[Vec<f64>; 2]| values.each_ref().map(|v| pick(v));
        let mut frames = StarFrames::new();
        frames.t_s = which.iter().map(|&k| all.t_s[k]).collect();
        for &k in which {
            let last = frames.first_row.last().copied().unwrap_or(0);
            frames.first_row.push(last + all.rows_of(k).len());
        }
        frames.slot = rows.iter().map(|&r| all.slot[r]).collect();
        frames.star_id = rows.iter().map(|&r| all.star_id[r]).collect();
        (frames.x_px, frames.y_px) = (pick(&all.x_px), pick(&all.y_px));
        let seen = |w: &Vec<f64>| if w.is_empty() { Vec::new() } else { pick(w) };
        Self {
            camera: self.camera.clone(),
            frames,
            stars: self.stars.clone(),
            star: rows.iter().map(|&r| self.star[r]).collect(),
            t_s: pick(&self.t_s),
            mag: pick(&self.mag),
            bv: pick(&self.bv),
            log_flux: pick(&self.log_flux),
            log_flux_change: pick(&self.log_flux_change),
            window_px: self.window_px.each_ref().map(seen),
            attitude: which.iter().map(|&k| self.attitude[k]).collect(),
            turned_back: self.turned_back.clone(),
            projected: pair(&self.projected),
            modelled: pair(&self.modelled),
            light: Light {
                beside_px: pair(&self.light.beside_px),
                variance_px2: pair(&self.light.variance_px2),
            },
            landed: self.landed.as_ref().map(pair),
            velocity: pair(&self.velocity),
            acceleration: pair(&self.acceleration),
            phase_error: pair(&self.phase_error),
            outlier: rows.iter().map(|&r| self.outlier[r]).collect(),
            ..*self
        }
    }

    /// Whether stars at these places hardly move but for what the reference puts them off by: then columns that cancel
    /// each other in what is the same all the time leave that.
    fn rest_at(&self, places: &[Vec<f64>; 2]) -> bool {
        let off = self.light.beside_px.iter().flatten();
        let off: f64 = off.map(|b| b * b).sum();
        if off == 0.0 {
            return false;
        }
        let mut sums = vec![[0.0; 5]; self.stars.len()];
        for (row, &star) in self.star.iter().enumerate() {
            let [x, y] = [0, 1].map(|a| places[a][row]);
            for (sum, value) in sums[star].iter_mut().zip([1.0, x, y, x * x, y * y]) {
                *sum += value;
            }
        }
        let moved = sums.iter().filter(|s| s[0] > 0.0);
        let moved: f64 = moved
            .map(|[n, x, y, xx, yy]| xx + yy - (x * x + y * y) / n)
            .sum();
        moved < RESTS * RESTS * off
    }

    /// Along an axis along which the light is not known to move, each star's falls at its mean place: of a position to a
    /// variance V that moves by M its estimates scatter by M + V. Waves whose slopes cancel in all but a turn of the
    /// frame would explain a slow error of the reference by what of it is in such estimates.
    fn hold_still(&mut self, places: &[Vec<f64>; 2]) {
        let at = self.light.beside(places);
        for (axis, at) in at.iter().enumerate() {
            let mut sums = vec![[0.0; 2]; self.stars.len()];
            for (&star, at) in self.star.iter().zip(at) {
                sums[star][0] += 1.0;
                sums[star][1] += at;
            }
            let off = |row: usize| at[row] - sums[self.star[row]][1] / sums[self.star[row]][0];
            let scatter: f64 = (0..at.len()).map(|row| off(row).powi(2)).sum();
            let seen = sums.iter().filter(|s| s[0] > 0.0).count();
            let scatter = scatter / at.len().saturating_sub(seen).max(1) as f64;
            let variance = &self.light.variance_px2[axis];
            let variance = variance.iter().sum::<f64>() / variance.len() as f64;
            let moves = (scatter - variance).max(0.0);
            self.still[axis] = moves < variance;
            if self.still[axis] {
                let off: Vec<f64> = (0..at.len()).map(off).collect();
                let beside = self.light.beside_px[axis].iter_mut();
                beside.zip(off).for_each(|(beside, off)| *beside -= off);
                self.light.variance_px2[axis].fill(moves);
            }
        }
    }

    /// Where the light falls, as far as is known, px.
    pub(crate) fn landed(&self) -> [&[f64]; 2] {
        let landed = self.landed.as_ref().unwrap_or(&self.modelled);
        landed.each_ref().map(Vec::as_slice)
    }

    /// Whether products of columns take long, and much room.
    pub(crate) fn is_long(&self) -> bool {
        self.t_s.len() > LONG_ROWS
    }

    /// Whether stars are not known to move.
    pub(crate) fn is_still(&self) -> bool {
        self.still == [true; 2]
    }

    /// Some rows, as candidates see them; the waves that these share are kept in `waves`.
    pub(crate) fn rows<'a>(
        &'a self,
        rows: Range<usize>,
        motion: Option<&'a dyn AttitudeSource>,
        waves: Option<&'a PixelWaves>,
    ) -> StarRows<'a> {
        StarRows {
            t_s: &self.t_s[rows.clone()],
            x_px: &self.modelled[0][rows.clone()],
            y_px: &self.modelled[1][rows.clone()],
            landed_px: self.landed().map(|p| &p[rows.clone()]),
            landed_variance_px2: self.light.variance_px2.each_ref().map(|v| &v[rows.clone()]),
            vx_px_s: &self.velocity[0][rows.clone()],
            vy_px_s: &self.velocity[1][rows.clone()],
            ax_px_s2: &self.acceleration[0][rows.clone()],
            ay_px_s2: &self.acceleration[1][rows.clone()],
            mag: &self.mag[rows.clone()],
            bv: &self.bv[rows.clone()],
            log_flux: &self.log_flux[rows.clone()],
            log_flux_change: &self.log_flux_change[rows.clone()],
            window_px: (self.window_px.each_ref()).map(|w| w.get(rows.clone()).unwrap_or_default()),
            slot: &self.frames.slot[rows.clone()],
            star_id: &self.frames.star_id[rows],
            waves,
            attitude: motion,
        }
    }

    /// Takes columns to be those at `modelled`, and the light to fall there or, where effects that were found take it
    /// far, at `carried`, px, each but for what the reference puts it off by; and evaluates what the declared model does
    /// to centroids there.
    pub(super) fn fall_at(
        &mut self,
        modelled: [Vec<f64>; 2],
        carried: Option<[Vec<f64>; 2]>,
        phase: &OnCentroids,
    ) {
        let rests = self.rest_at(&modelled);
        self.still = [false; 2];
        if rests {
            self.hold_still(&modelled);
        }
        let own = carried.is_some() || !rests && self.light.is_beside();
        let landed = own.then(|| self.light.beside(carried.as_ref().unwrap_or(&modelled)));
        self.modelled = match rests {
            true => self.light.beside(&modelled),
            false => modelled,
        };
        self.landed = landed;
        self.phase_error = self.centroid_error_px(self.landed(), phase);
    }

    /// What the declared model does to centroids of light that falls `at` these places, px.
    pub(super) fn centroid_error_px(&self, at: [&[f64]; 2], phase: &OnCentroids) -> [Vec<f64>; 2] {
        let rows = self.t_s.len();
        let mut error = [vec![0.0; rows], vec![0.0; rows]];
        let [x, y] = &mut error;
        let own = phase
            .error
            .scaled(self.camera.arcsec_per_px().map(|s| 1.0 / s));
        let centre = self.camera.pixel_centre();
        let parts = x.par_chunks_mut(TOGETHER).zip(y.par_chunks_mut(TOGETHER));
        parts.enumerate().for_each(|(part, (x, y))| {
            let first = part * TOGETHER;
            let some = first..first + x.len();
            let variance = self.light.variance_px2.each_ref();
            let variance = variance.map(|v| &v[some.clone()]);
            let [at_x, at_y] = at.map(|at| &at[some.clone()]);
            let out = PointsMut {
                x: &mut *x,
                y: &mut *y,
            };
            own.mean_error_into(Points { x: at_x, y: at_y }, variance, centre, out);
            if !phase.has_effects() {
                return;
            }
            for (k, row) in some.enumerate() {
                let star = StarView {
                    at: Pixel {
                        x: at_x[k],
                        y: at_y[k],
                    },
                    ..self.view(row)
                };
                let shift = phase.effects_px(&star, variance.map(|v| v[k]));
                x[k] += shift[0];
                y[k] += shift[1];
            }
        });
        error
    }

    /// A row as effects with values see it, at its modelled position.
    pub(crate) fn view(&self, row: usize) -> StarView {
        StarView {
            t_s: self.t_s[row],
            slot: self.frames.slot[row],
            star_id: self.frames.star_id[row],
            mag: self.mag[row],
            bv: self.bv[row],
            at: Pixel {
                x: self.modelled[0][row],
                y: self.modelled[1][row],
            },
        }
    }

    /// The residual of the measured centroids, arcsec.
    pub(crate) fn measured_residual(&self) -> [Vec<f64>; 2] {
        self.residual_arcsec(self.frames.positions())
    }

    /// The same without the misalignment that the projection goes through.
    pub(crate) fn bare_residual(&self, measured: Points<'_>) -> [Vec<f64>; 2] {
        let scale = self.camera.arcsec_per_px();
        let axis = |i: usize, measured: &[f64]| {
            (0..measured.len())
                .map(|r| (measured[r] - self.projected[i][r] - self.phase_error[i][r]) * scale[i])
                .collect()
        };
        [axis(0, measured.x), axis(1, measured.y)]
    }

    /// The residual of centroids `x_px, y_px` (the measured ones, or others
    /// formed anew), arcsec.
    pub(crate) fn residual_arcsec(&self, measured: Points<'_>) -> [Vec<f64>; 2] {
        let mut out = self.bare_residual(measured);
        for frame in 0..self.frames.frames() {
            for row in self.frames.rows_of(frame) {
                let turned = self.turned_arcsec(row, frame);
                for axis in 0..2 {
                    out[axis][row] += turned[axis];
                }
            }
        }
        out
    }
}

/// Takes the attitude from frames around which it is not known how the tracker moved, where it is
/// around others: what acts on the motion would seem not to act on them.
fn set_aside_lost(inputs: &Inputs<'_>, attitude: &mut [Option<UnitQuaternion<f64>>]) {
    let solved: Vec<usize> = (0..attitude.len())
        .filter(|&k| attitude[k].is_some())
        .collect();
    let t_s: Vec<f64> = solved.iter().map(|&k| inputs.frames.t_s[k]).collect();
    let own = || {
        let q = attitude.iter().copied().flatten().collect();
        AttitudeSeries::new(t_s.clone(), q, None).ok()
    };
    let arm = motion::roll_arm(inputs.camera);
    let lost = match inputs.reference {
        Some(reference) => motion::lost(reference, &t_s, arm),
        None => own().map_or_else(Vec::new, |own| motion::lost(&own, &t_s, arm)),
    };
    for (&k, _) in solved.iter().zip(lost).filter(|(_, lost)| *lost) {
        attitude[k] = None;
    }
}

#[cfg(test)]
mod tests {
    use telemetry::Model;

    use super::*;
    use crate::star::harness::at_rest;

    /// Stars that drift by a pixel a frame, and a reference that puts them off by a tenth of it.
    #[test]
    fn light_falls_beside_where_it_is_modelled_or_carried() {
        let mut data = at_rest((0..40).map(f64::from).collect());
        let phase = OnCentroids::from(&Model::default());
        let rows = data.t_s.len();
        let moved = |by: f64| -> [Vec<f64>; 2] {
            data.projected.each_ref().map(|axis| {
                let frame = |row: usize| (row / data.stars.len()) as f64;
                axis.iter()
                    .enumerate()
                    .map(|(row, p)| p + frame(row) + by)
                    .collect()
            })
        };
        let [modelled, beside, carried] = [0.0, 0.1, 30.1].map(moved);
        data.fall_at(modelled.clone(), None, &phase);
        assert_eq!(data.landed().map(<[f64]>::to_vec), modelled);
        data.light.beside_px = [0, 1].map(|_| vec![0.1; rows]);
        for (from, falls) in [(None, &beside), (Some(moved_back(&carried)), &carried)] {
            data.fall_at(modelled.clone(), from, &phase);
            assert_eq!(data.modelled, modelled);
            for (ours, other) in data.landed().iter().zip(falls) {
                let off = ours.iter().zip(other).map(|(a, b)| (a - b).abs());
                assert!(off.fold(0.0, f64::max) < 1e-9);
            }
        }
    }

    /// Less what the reference puts them off by.
    fn moved_back(places: &[Vec<f64>; 2]) -> [Vec<f64>; 2] {
        places
            .each_ref()
            .map(|axis| axis.iter().map(|p| p - 0.1).collect())
    }
}
