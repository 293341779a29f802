//! What a run looks like before any error is judged: field, motion, tracks.
//!
//! ```text
//! reference    theta(t) = log(q(t) q(t_0)^-1), the straight line through it removed      arcsec
//! rate         omega(t), tracker axes                                                    deg/s
//! ```
//!
//! Source: \[M23\] Figs. 2, 3, 6, 7, 9, 10, 15.

use std::collections::BTreeMap;

use focal_plane::{
    ARCSEC_PER_RAD, AttitudeSource, Camera, Normalised, Pixel, StarFrames, rotation_vector,
};
use spectra::Psd;
use star_tracker::Pbm;

use crate::Spectrum;

/// Arrows along a side of the detector.
const ARROWS: usize = 21;
/// Pixels over which the centroid error is shown, and points to a pixel.
const PIXELS: usize = 3;
const POINTS: usize = 60;

/// One star along the run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Track {
    /// Its id.
    pub star_id: i64,
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Measured positions, px.
    pub x_px: Vec<f64>,
    /// Measured positions, px.
    pub y_px: Vec<f64>,
}

/// Data of the figures; what the run does not have is `None` or empty.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Half the detector along x and y, px.
    pub half_size_px: [f64; 2],
    /// Distortion over the detector: x, y in px, dx, dy in arcsec.
    pub distortion: Option<[Vec<f64>; 4]>,
    /// Centroid error over some pixels: position in px, error along x and along y in arcsec.
    pub centroid: Option<[Vec<f64>; 3]>,
    /// One-sided density of the motion about x, y, z, arcsec^2/Hz.
    pub motion: Option<[Psd; 3]>,
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Rate about x, y, z at these times, deg/s.
    pub rate_deg_s: [Vec<f64>; 3],
    /// The stars, those seen longest first.
    pub tracks: Vec<Track>,
}

impl Scene {
    /// The data of a run: the tracker, the attitude at `t_s`, and the stars that were seen.
    #[must_use]
    pub fn new(
        tracker: &Pbm,
        attitude: &dyn AttitudeSource,
        t_s: &[f64],
        stars: Option<&StarFrames>,
    ) -> Self {
        let camera = tracker.camera();
        let rates: Vec<_> = t_s
            .iter()
            .filter_map(|&t| Some((t, attitude.rate_rad_s(t)?)))
            .collect();
        Self {
            half_size_px: camera.half_size_px(),
            distortion: distortion(tracker, camera),
            centroid: centroid(tracker, camera),
            motion: motion(attitude, t_s),
            t_s: rates.iter().map(|(t, _)| *t).collect(),
            rate_deg_s: [0, 1, 2]
                .map(|axis| rates.iter().map(|(_, w)| w[axis].to_degrees()).collect()),
            tracks: stars.map_or_else(Vec::new, tracks),
        }
    }
}

fn distortion(tracker: &Pbm, camera: &Camera) -> Option<[Vec<f64>; 4]> {
    let half = camera.half_size_px();
    let mut out: [Vec<f64>; 4] = Default::default();
    for j in 0..ARROWS {
        for i in 0..ARROWS {
            // the middle of each of 21 by 21 cells
            let [u, v] = [i, j].map(|k| (2 * k + 1) as f64 / ARROWS as f64 - 1.0);
            let [dx, dy] = tracker.distortion().evaluate(Normalised { x: u, y: v });
            for (column, value) in out.iter_mut().zip([u * half[0], v * half[1], dx, dy]) {
                column.push(value);
            }
        }
    }
    let any = out[2].iter().chain(&out[3]).any(|d| d.abs() > 0.0);
    any.then_some(out)
}

fn centroid(tracker: &Pbm, camera: &Camera) -> Option<[Vec<f64>; 3]> {
    let mut out: [Vec<f64>; 3] = Default::default();
    for k in 0..=PIXELS * POINTS {
        let at = k as f64 / POINTS as f64;
        let [ex, ey] = tracker
            .centroid_error()
            .error_at(Pixel { x: at, y: at }, camera.pixel_centre());
        for (column, value) in out.iter_mut().zip([at, ex, ey]) {
            column.push(value);
        }
    }
    let any = out[1].iter().chain(&out[2]).any(|e| e.abs() > 0.0);
    any.then_some(out)
}

fn motion(attitude: &dyn AttitudeSource, t_s: &[f64]) -> Option<[Psd; 3]> {
    let known: Vec<_> = t_s
        .iter()
        .filter_map(|&t| Some((t, attitude.attitude(t)?)))
        .collect();
    let (first_s, first) = *known.first()?;
    let times: Vec<f64> = known.iter().map(|(t, _)| *t).collect();
    let axis = |axis: usize| -> Option<Psd> {
        let theta: Vec<f64> = known
            .iter()
            .map(|(_, q)| rotation_vector(q, &first)[axis] * ARCSEC_PER_RAD)
            .collect();
        let line = straight(&times, &theta);
        let left: Vec<f64> = times
            .iter()
            .zip(&theta)
            .map(|(t, theta)| theta - line[0] - line[1] * (t - first_s))
            .collect();
        Spectrum::new(&times, &left)
            .and_then(|plan| plan.of(&left))
            .ok()
    };
    Some([axis(0)?, axis(1)?, axis(2)?])
}

/// Value at the first time, and slope, of the line of least squares.
fn straight(t_s: &[f64], y: &[f64]) -> [f64; 2] {
    let n = t_s.len() as f64;
    let (mt, my) = (t_s.iter().sum::<f64>() / n, y.iter().sum::<f64>() / n);
    let pairs = || t_s.iter().zip(y);
    let cross: f64 = pairs().map(|(t, y)| (t - mt) * (y - my)).sum();
    let square: f64 = t_s.iter().map(|t| (t - mt).powi(2)).sum();
    let slope = if square > 0.0 { cross / square } else { 0.0 };
    [my - slope * (mt - t_s[0]), slope]
}

fn tracks(stars: &StarFrames) -> Vec<Track> {
    let mut by_id: BTreeMap<i64, Track> = BTreeMap::new();
    for (k, &t) in stars.t_s.iter().enumerate() {
        for row in stars.rows_of(k) {
            let star_id = stars.star_id[row];
            let track = by_id.entry(star_id).or_insert_with(|| Track {
                star_id,
                ..Track::default()
            });
            track.t_s.push(t);
            track.x_px.push(stars.x_px[row]);
            track.y_px.push(stars.y_px[row]);
        }
    }
    let mut out: Vec<Track> = by_id.into_values().collect();
    out.sort_by_key(|track| std::cmp::Reverse(track.t_s.len()));
    out
}

#[cfg(test)]
mod tests {
    use focal_plane::UniformRotation;

    use super::*;

    /// A run at rest: its line takes everything, and a tracker without errors has neither field nor triangle.
    #[test]
    fn a_tracker_at_rest_shows_its_stars_only() {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let t_s: Vec<f64> = (0..100).map(f64::from).collect();
        let mut stars = StarFrames::new();
        for &t in &t_s {
            stars.begin(t);
            stars.push(0, 7, 1.0, 2.0);
            if t > 50.0 {
                stars.push(1, 3, -1.0, 5.0);
            }
        }
        let scene = Scene::new(
            &Pbm::new(camera),
            &UniformRotation::default(),
            &t_s,
            Some(&stars),
        );
        assert!(scene.distortion.is_none() && scene.centroid.is_none());
        assert_eq!(scene.tracks.len(), 2);
        assert_eq!(
            (scene.tracks[0].star_id, scene.tracks[1].t_s.len()),
            (7, 49)
        );
        assert!(scene.rate_deg_s.iter().flatten().all(|w| w.abs() < 1e-12));
    }

    /// A turn at a constant rate about one axis is a straight line: no motion is left but rounding, 1e-9 arcsec.
    #[test]
    fn a_steady_turn_leaves_no_motion() {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let t_s: Vec<f64> = (0..500).map(f64::from).collect();
        let turn = UniformRotation {
            rate_rad_s: nalgebra::Vector3::new(1e-4, 0.0, 0.0),
            ..UniformRotation::default()
        };
        let scene = Scene::new(&Pbm::new(camera), &turn, &t_s, None);
        let [x, ..] = scene.motion.unwrap();
        assert!(x.psd.iter().all(|p| *p < 1e-12), "{:?}", x.psd);
        assert!((scene.rate_deg_s[0][3] - 1e-4_f64.to_degrees()).abs() < 1e-12);
    }

    #[test]
    fn a_line_is_taken_away_whole() {
        let t: Vec<f64> = (0..50).map(|k| 100.0 + f64::from(k)).collect();
        let y: Vec<f64> = t.iter().map(|t| 3.0 - 0.25 * (t - 100.0)).collect();
        let [at, slope] = straight(&t, &y);
        assert!((at - 3.0).abs() < 1e-12 && (slope + 0.25).abs() < 1e-12);
    }
}
