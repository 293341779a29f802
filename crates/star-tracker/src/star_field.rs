//! Which stars are tracked: a generated sky, or a catalogue.
//!
//! The generated sky follows \[M23\] Step 1. A star that leaves the field is replaced by a new one drawn
//! uniformly inside a box:
//!
//! ```text
//! centre      (-x_c, -y_c),  (x_c, y_c) the mean of the remaining stars
//! half-width  min( s_x / 2, X - |x_c| ),  s_x their standard deviation, X the half-size of the field
//! ```
//!
//! and the same in y, so that the box (full width `s_x`) is no larger than the spread of the remaining
//! stars and wholly inside the field. The box sits opposite to the remaining stars, which keeps the
//! field balanced. With fewer than two stars left there is no spread: the box is the whole field.
//!
//! "Not already tracked" is kept by giving every new star a new identity and by drawing again while it
//! lies within [`StarField::MIN_SEPARATION_PX`] of a tracked star.
//!
//! Catalogue stars are chosen by [`CatalogueTracking`]: a tracked star is kept for as long as it is in
//! the field, and a free slot takes the brightest star that is not tracked.
//!
//! Source: \[M23\] Section 2.6, Step 1. Magnitudes and colours of the generated stars are an assumption:
//! counts rise as 10^(0.5 m) up to the limit, B - V is normal (0.6, 0.5) clipped to [-0.3, 2.0].

use focal_plane::{Camera, Catalogue, Pixel};
use nalgebra::{UnitQuaternion, Vector3};
use rand_core::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::TrackerError;

/// A star as the tracker follows it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldStar {
    /// Identity.
    pub id: i64,
    /// Inertial unit vector.
    pub direction: Vector3<f64>,
    /// Magnitude.
    pub mag: f64,
    /// Colour B - V.
    pub bv: f64,
}

/// A generated sky: one star per slot, replaced when it leaves the field.
#[derive(Clone, Debug, PartialEq)]
pub struct StarField {
    slots: Vec<FieldStar>,
    next_id: i64,
}

impl StarField {
    /// A new star keeps this distance from every tracked one on at least one axis, px: two spots in
    /// one window could not be told apart.
    pub const MIN_SEPARATION_PX: f64 = 6.0;
    /// Faintest generated star.
    pub const LIMITING_MAG: f64 = 6.0;
    /// Brightest generated star.
    pub const BRIGHTEST_MAG: f64 = 1.0;

    /// `stars` stars spread evenly over the field as seen at attitude `q` (inertial to tracker).
    ///
    /// # Errors
    /// Fewer than two stars cannot fix an attitude.
    pub fn generate<R: Rng + ?Sized>(
        camera: &Camera,
        q: &UnitQuaternion<f64>,
        stars: usize,
        rng: &mut R,
    ) -> Result<Self, TrackerError> {
        if stars < 2 {
            return Err(TrackerError::TooFewStars {
                got: stars,
                need: 2,
            });
        }
        let mut field = Self {
            slots: Vec::with_capacity(stars),
            next_id: 1,
        };
        let mut seen: Vec<Pixel> = Vec::with_capacity(stars);
        let [hx, hy] = camera.half_size_px();
        for _ in 0..stars {
            let at = draw_apart([[-hx, hx], [-hy, hy]], &seen, rng);
            seen.push(at);
            let star = field.new_star(camera, q, at, rng);
            field.slots.push(star);
        }
        Ok(field)
    }

    /// Stars given from outside, one per slot.
    ///
    /// # Errors
    /// Fewer than two stars cannot fix an attitude.
    pub fn from_stars(stars: Vec<FieldStar>) -> Result<Self, TrackerError> {
        if stars.len() < 2 {
            return Err(TrackerError::TooFewStars {
                got: stars.len(),
                need: 2,
            });
        }
        let next_id = stars
            .iter()
            .map(|star| star.id)
            .max()
            .map_or(1, |id| id + 1);
        Ok(Self {
            slots: stars,
            next_id,
        })
    }

    /// The stars, slot by slot.
    pub fn stars(&self) -> &[FieldStar] {
        &self.slots
    }

    /// Replaces every star that is out of the field at attitude `q`; returns how many.
    ///
    /// Each star is replaced in the order of its slot; stars placed before it in this call count as
    /// remaining.
    pub fn update<R: Rng + ?Sized>(
        &mut self,
        camera: &Camera,
        q: &UnitQuaternion<f64>,
        rng: &mut R,
    ) -> usize {
        let inside = |star: &FieldStar| {
            camera
                .project(&(q * star.direction))
                .filter(|at| camera.contains(*at))
        };
        let mut remaining: Vec<Pixel> = Vec::new();
        let mut gone: Vec<usize> = Vec::new();
        for (slot, star) in self.slots.iter().enumerate() {
            match inside(star) {
                Some(at) => remaining.push(at),
                None => gone.push(slot),
            }
        }
        for &slot in &gone {
            let at = draw_apart(replacement_box(camera, &remaining), &remaining, rng);
            remaining.push(at);
            self.slots[slot] = self.new_star(camera, q, at, rng);
        }
        gone.len()
    }

    fn new_star<R: Rng + ?Sized>(
        &mut self,
        camera: &Camera,
        q: &UnitQuaternion<f64>,
        at: Pixel,
        rng: &mut R,
    ) -> FieldStar {
        let id = self.next_id;
        self.next_id += 1;
        // inverse of the cumulative count N(< m) ~ 10^(0.5 m), cut at the bright end
        let bright = 10_f64.powf(0.5 * (Self::BRIGHTEST_MAG - Self::LIMITING_MAG));
        let u = bright + (1.0 - bright) * uniform(rng);
        let colour: f64 = StandardNormal.sample(rng);
        FieldStar {
            id,
            direction: q.inverse() * camera.direction(at),
            mag: Self::LIMITING_MAG + 2.0 * u.log10(),
            bv: (0.6 + 0.5 * colour).clamp(-0.3, 2.0),
        }
    }
}

/// The box of \[M23\] Step 1 for a new star, given where the remaining stars are: `[x, y]` ranges, px.
pub fn replacement_box(camera: &Camera, remaining: &[Pixel]) -> [[f64; 2]; 2] {
    let half = camera.half_size_px();
    if remaining.len() < 2 {
        return [[-half[0], half[0]], [-half[1], half[1]]];
    }
    let range = |values: &dyn Fn(&Pixel) -> f64, half: f64| {
        let n = remaining.len() as f64;
        let mean = remaining.iter().map(values).sum::<f64>() / n;
        let spread = (remaining
            .iter()
            .map(|p| (values(p) - mean).powi(2))
            .sum::<f64>()
            / n)
            .sqrt();
        let width = (0.5 * spread).min(half - mean.abs());
        [-mean - width, -mean + width]
    };
    [range(&|p| p.x, half[0]), range(&|p| p.y, half[1])]
}

/// A point uniform in the box, away from `others`. When the box is too crowded for that (it can be as
/// small as the spread of a tight cluster) the last try stands after 100.
fn draw_apart<R: Rng + ?Sized>(bounds: [[f64; 2]; 2], others: &[Pixel], rng: &mut R) -> Pixel {
    let mut draw = || {
        let [x, y] = bounds.map(|[low, high]| low + (high - low) * uniform(rng));
        Pixel { x, y }
    };
    let apart = |p: &Pixel| {
        others
            .iter()
            .all(|o| (p.x - o.x).abs().max((p.y - o.y).abs()) >= StarField::MIN_SEPARATION_PX)
    };
    let mut at = draw();
    for _ in 0..100 {
        if apart(&at) {
            break;
        }
        at = draw();
    }
    at
}

/// Uniform in [0, 1) from the upper 53 bits.
pub(crate) fn uniform<R: Rng + ?Sized>(rng: &mut R) -> f64 {
    (rng.next_u64() >> 11) as f64 * (1.0 / (1_u64 << 53) as f64)
}

/// Tracking of catalogue stars: bright first, kept while they are in the field.
#[derive(Clone, Debug)]
pub struct CatalogueTracking<'a> {
    catalogue: &'a Catalogue,
    directions: Vec<Vector3<f64>>,
    /// Catalogue indices, bright first.
    by_brightness: Vec<usize>,
    /// Catalogue index per slot.
    slots: Vec<Option<usize>>,
    margin_px: f64,
}

impl<'a> CatalogueTracking<'a> {
    /// Follows up to `slots` stars no fainter than `limiting_mag`, with directions at `year` (Julian).
    /// Stars within `margin_px` of the edge are neither taken nor kept.
    pub fn new(
        catalogue: &'a Catalogue,
        year: f64,
        slots: usize,
        limiting_mag: f64,
        margin_px: f64,
    ) -> Self {
        let stars = catalogue.stars();
        let mut by_brightness: Vec<usize> = (0..stars.len())
            .filter(|&i| stars[i].mag <= limiting_mag)
            .collect();
        by_brightness.sort_by(|&a, &b| {
            stars[a]
                .mag
                .total_cmp(&stars[b].mag)
                .then(stars[a].id.cmp(&stars[b].id))
        });
        Self {
            catalogue,
            directions: catalogue.directions_at(year),
            by_brightness,
            slots: vec![None; slots],
            margin_px,
        }
    }

    /// Hands over at attitude `q`: drops stars that left, fills free slots with the brightest stars in
    /// the field that are not tracked; returns how many slots changed. A slot stays empty when the
    /// field has no more stars.
    pub fn update(&mut self, camera: &Camera, q: &UnitQuaternion<f64>) -> usize {
        let boresight = q.inverse() * Vector3::z();
        let half = camera.half_size_px();
        let focal = camera.focal_length_px();
        let corner = (half[0] / focal[0]).hypot(half[1] / focal[1]).atan();
        let edge = corner.cos();
        let mut changed = 0;
        for slot in 0..self.slots.len() {
            if let Some(index) = self.slots[slot]
                && !self.inside(camera, q, index)
            {
                self.slots[slot] = None;
                changed += 1;
            }
        }
        let mut free: Vec<usize> = (0..self.slots.len())
            .rev()
            .filter(|&slot| self.slots[slot].is_none())
            .collect();
        let before = free.len();
        if before == 0 {
            return changed;
        }
        for k in 0..self.by_brightness.len() {
            let index = self.by_brightness[k];
            // the cone round the field first: a dot product for most of the sky
            if self.directions[index].dot(&boresight) < edge
                || self.slots.contains(&Some(index))
                || !self.inside(camera, q, index)
            {
                continue;
            }
            let Some(slot) = free.pop() else { break };
            self.slots[slot] = Some(index);
        }
        changed.max(before - free.len())
    }

    /// The tracked stars with their slots, slot by slot; empty slots are left out.
    pub fn stars(&self) -> impl Iterator<Item = (i32, FieldStar)> + '_ {
        (0_i32..).zip(&self.slots).filter_map(|(slot, index)| {
            let star = &self.catalogue.stars()[(*index)?];
            let direction = self.directions[(*index)?];
            Some((
                slot,
                FieldStar {
                    id: star.id,
                    direction,
                    mag: star.mag,
                    bv: star.bv,
                },
            ))
        })
    }

    fn inside(&self, camera: &Camera, q: &UnitQuaternion<f64>, index: usize) -> bool {
        let half = camera.half_size_px();
        camera
            .project(&(q * self.directions[index]))
            .is_some_and(|p| {
                p.x.abs() <= half[0] - self.margin_px && p.y.abs() <= half[1] - self.margin_px
            })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Purpose, stream};

    fn camera() -> Camera {
        Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap()
    }

    /// Slews by 40 deg: every replacement is inside the field and inside the box of the rule, ids are
    /// never used twice, and the tracked stars stay balanced about the boresight.
    #[test]
    fn replacements_follow_step_one() {
        let camera = camera();
        let mut rng = stream(3, 0, Purpose::StarField);
        let at = |k: u32| UnitQuaternion::from_axis_angle(&Vector3::y_axis(), 0.002 * f64::from(k));
        let mut field = StarField::generate(&camera, &at(0), 14, &mut rng).unwrap();
        let mut ids: std::collections::HashSet<i64> = field.stars().iter().map(|s| s.id).collect();
        let mut replaced = 0;
        for k in 1..350 {
            let q = at(k);
            let before = field.clone();
            let seen = |f: &StarField, i: usize| camera.project(&(q * f.stars()[i].direction));
            let gone: Vec<usize> = (0..14)
                .filter(|&i| !seen(&before, i).is_some_and(|p| camera.contains(p)))
                .collect();
            assert_eq!(field.update(&camera, &q, &mut rng), gone.len());
            let mut remaining: Vec<Pixel> = (0..14)
                .filter(|i| !gone.contains(i))
                .map(|i| seen(&before, i).unwrap())
                .collect();
            for &slot in &gone {
                let p = seen(&field, slot).unwrap();
                let [x, y] = replacement_box(&camera, &remaining);
                // 1e-9 px: the projection of a direction made from the pixel
                assert!(
                    p.x > x[0] - 1e-9
                        && p.x < x[1] + 1e-9
                        && p.y > y[0] - 1e-9
                        && p.y < y[1] + 1e-9
                );
                assert!(camera.contains(p));
                assert!(
                    ids.insert(field.stars()[slot].id),
                    "a new star has a new identity"
                );
                remaining.push(p);
                replaced += 1;
            }
        }
        assert!(replaced > 10, "the slew replaced {replaced} stars");
    }

    #[test]
    fn the_box_lies_opposite_to_the_remaining_stars() {
        let camera = camera();
        let stars = [(-400.0, 10.0), (-500.0, 30.0), (-450.0, -40.0)].map(|(x, y)| Pixel { x, y });
        let [x, y] = replacement_box(&camera, &stars);
        assert!((0.5 * (x[0] + x[1]) - 450.0).abs() < 1e-9 && (0.5 * (y[0] + y[1])).abs() < 1e-9);
        // spread in x: sqrt(5000/3) = 40.8; the field's edge leaves 62
        assert!((x[1] - x[0] - (5000.0_f64 / 3.0).sqrt()).abs() < 1e-9);
        let wide =
            [(-500.0, 0.0), (510.0, 0.0), (511.0, 1.0), (509.0, 3.0)].map(|(x, y)| Pixel { x, y });
        let [x, _] = replacement_box(&camera, &wide);
        assert!(x[0] >= -512.0 && x[1] <= 512.0);
        assert_eq!(replacement_box(&camera, &stars[..1]), [[-512.0, 512.0]; 2]);
    }

    #[test]
    fn one_star_is_an_error() {
        let mut rng = stream(1, 0, Purpose::StarField);
        let got = StarField::generate(&camera(), &UnitQuaternion::identity(), 1, &mut rng);
        assert_eq!(got, Err(TrackerError::TooFewStars { got: 1, need: 2 }));
    }
}
