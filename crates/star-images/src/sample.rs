//! Windows joined to the star rows that they belong to.
//!
//! ```text
//! pixel (column c, row r) of a window lies at  (x0 + c, y0 + r)   px
//! detector pixel = (round(x0 - x_ref) + c, round(y0 - y_ref) + r),   x_ref, y_ref of the first window
//! ```
//!
//! Pixels are counted from the first window, so that centres at whole and at
//! half-integer numbers need no telling apart. Values are scaled such that the
//! median flux is 10^4: the starting values of the estimators are then numbers
//! of a known size, whatever the unit of the windows.
//!
//! Not physics: bookkeeping.

use std::collections::BTreeMap;

use super::robust::robust_median;

/// Median flux of a window after scaling.
const FLUX_SCALE: f64 = 1e4;
/// Coarser than any rounding of a pixel position, finer than any pixel.
const MAX_PIXEL_INDEX: f64 = 1e6;

/// One window as it enters a [`Sample`].
#[derive(Clone, Debug)]
pub(crate) struct Entry<'a> {
    /// Row of the stars table.
    pub(crate) row: usize,
    pub(crate) t_s: f64,
    pub(crate) star: usize,
    /// Centroid of the stars table, px.
    pub(crate) start: [f64; 2],
    /// Flux of the stars table, if it has one.
    pub(crate) flux: Option<f64>,
    /// Where attitude and catalogue put the star, px.
    pub(crate) base: [f64; 2],
    /// How a small rotation moves it, px/rad.
    pub(crate) jacobian: [[f64; 3]; 2],
    /// Centre of the first pixel, px.
    pub(crate) corner: [f64; 2],
    pub(crate) background: f64,
    /// All pixels, row by row.
    pub(crate) values: &'a [f64],
}

/// Windows of all frames, structure of arrays, frames contiguous.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub(crate) stars: usize,
    /// First window of each frame, and the end of the last.
    pub(crate) first_window: Vec<usize>,
    pub(crate) row: Vec<usize>,
    pub(crate) t_s: Vec<f64>,
    pub(crate) star: Vec<usize>,
    pub(crate) start: Vec<[f64; 2]>,
    pub(crate) flux: Vec<f64>,
    pub(crate) background: Vec<f64>,
    pub(crate) base: Vec<[f64; 2]>,
    pub(crate) jacobian: Vec<[[f64; 3]; 2]>,
    pub(crate) corner: Vec<[f64; 2]>,
    /// Columns and rows of a window.
    pub(crate) size: [usize; 2],
    /// Column and row of each pixel that is read out.
    pub(crate) cells: Vec<[usize; 2]>,
    /// Values, `cells.len()` a window.
    pub(crate) z: Vec<f64>,
    /// Values that are numbers.
    pub(crate) valid: Vec<bool>,
    /// Detector pixel behind each value.
    pub(crate) pixel: Vec<usize>,
    /// Centre of each detector pixel, px.
    pub(crate) centre: Vec<[f64; 2]>,
    /// Group of each detector pixel: stars whose windows share pixels share a group.
    pub(crate) group: Vec<usize>,
    /// Table's unit in a unit of `z`.
    pub(crate) unit: f64,
}

impl Sample {
    /// Collects windows, frame by frame. Windows whose numbers cannot be used are
    /// left out. `None` if nothing is left.
    pub(crate) fn collect(
        stars: usize,
        size: [usize; 2],
        unread: &[bool],
        frames: &[Vec<Entry<'_>>],
    ) -> Option<Self> {
        let cells: Vec<[usize; 2]> = (0..size[0] * size[1])
            .filter(|&i| !unread.get(i).copied().unwrap_or(false))
            .map(|i| [i % size[0], i / size[0]])
            .collect();
        let mut sample = Self {
            stars,
            first_window: vec![0],
            row: Vec::new(),
            t_s: Vec::new(),
            star: Vec::new(),
            start: Vec::new(),
            flux: Vec::new(),
            background: Vec::new(),
            base: Vec::new(),
            jacobian: Vec::new(),
            corner: Vec::new(),
            size,
            cells,
            z: Vec::new(),
            valid: Vec::new(),
            pixel: Vec::new(),
            centre: Vec::new(),
            group: Vec::new(),
            unit: 1.0,
        };
        let table = frames
            .iter()
            .flatten()
            .all(|e| e.flux.is_some_and(|f| f.is_finite() && f > 0.0));
        let mut pixels = Pixels::default();
        for frame in frames {
            for entry in frame {
                sample.push(entry, table, &mut pixels);
            }
            sample.first_window.push(sample.row.len());
        }
        sample.centre = pixels.centre;
        sample.group = sample.groups();
        let sums: Vec<f64> = (0..sample.windows()).map(|w| sample.sum(w)).collect();
        let (unit, scale) = (
            robust_median(sums.clone())?,
            robust_median(sample.flux.clone())?,
        );
        if !(unit > 0.0 && scale > 0.0) {
            return None;
        }
        sample.unit = unit / FLUX_SCALE;
        for v in sample.z.iter_mut().chain(&mut sample.background) {
            *v /= sample.unit;
        }
        for f in &mut sample.flux {
            *f = (*f / scale).max(1e-3) * FLUX_SCALE;
        }
        Some(sample)
    }

    fn push(&mut self, entry: &Entry<'_>, table_flux: bool, pixels: &mut Pixels) {
        let numbers = [entry.start, entry.base, entry.corner];
        let usable = numbers.into_iter().all(on_a_detector)
            && entry.jacobian.as_flattened().iter().all(|v| v.is_finite());
        let values = || {
            self.cells
                .iter()
                .map(|&[c, r]| entry.values[r * self.size[0] + c])
        };
        if !usable || !read_enough(values()) {
            return;
        }
        let lowest = values()
            .filter(|v| v.is_finite())
            .fold(f64::INFINITY, f64::min);
        let background = if entry.background.is_finite() {
            entry.background
        } else {
            lowest
        };
        let values: Vec<f64> = values().collect();
        let corner = pixels.index(entry.corner);
        for (&[c, r], v) in self.cells.iter().zip(values) {
            self.valid.push(v.is_finite());
            self.z.push(if v.is_finite() { v } else { 0.0 });
            let offset = |n: usize| i64::try_from(n).unwrap_or(i64::MAX / 2);
            let key = [corner[0] + offset(c), corner[1] + offset(r)];
            self.pixel.push(pixels.number(key));
        }
        self.row.push(entry.row);
        self.t_s.push(entry.t_s);
        self.star.push(entry.star);
        self.start.push(entry.start);
        self.background.push(background);
        self.base.push(entry.base);
        self.jacobian.push(entry.jacobian);
        self.corner.push(entry.corner);
        let flux = if table_flux { entry.flux } else { None };
        self.flux
            .push(flux.unwrap_or_else(|| self.sum(self.row.len() - 1)));
    }

    /// Groups of pixels, numbered by the first star in them.
    fn groups(&self) -> Vec<usize> {
        let mut owner = vec![usize::MAX; self.centre.len()];
        let mut joined: Vec<usize> = (0..self.stars).collect();
        let root = |joined: &[usize], mut star: usize| {
            while joined[star] != star {
                star = joined[star];
            }
            star
        };
        for w in 0..self.windows() {
            let star = self.star[w];
            for &p in &self.pixel[self.cells_of(w)] {
                if owner[p] == usize::MAX {
                    owner[p] = star;
                } else if owner[p] != star {
                    let (a, b) = (root(&joined, owner[p]), root(&joined, star));
                    joined[a.max(b)] = a.min(b);
                }
            }
        }
        owner.into_iter().map(|star| root(&joined, star)).collect()
    }

    /// Light in window `w` above its background.
    fn sum(&self, w: usize) -> f64 {
        let cells = self.cells_of(w);
        let (z, valid) = (&self.z[cells.clone()], &self.valid[cells]);
        z.iter()
            .zip(valid)
            .filter(|(_, v)| **v)
            .map(|(z, _)| z - self.background[w])
            .sum()
    }

    pub(crate) fn windows(&self) -> usize {
        self.row.len()
    }

    /// Indices of the pixels of window `w`.
    pub(crate) fn cells_of(&self, w: usize) -> std::ops::Range<usize> {
        w * self.cells.len()..(w + 1) * self.cells.len()
    }

    /// Offsets of the columns (`axis` 0) or rows (1) of window `w` from `at`, px.
    pub(crate) fn offsets(&self, w: usize, axis: usize, at: [f64; 2]) -> impl Iterator<Item = f64> {
        let first = self.corner[w][axis] - at[axis];
        (0..self.size[axis]).map(move |i| first + i as f64)
    }

    /// Windows of frame `k`.
    pub(crate) fn windows_of(&self, k: usize) -> std::ops::Range<usize> {
        self.first_window[k]..self.first_window[k + 1]
    }

    /// Windows of each star in the frames that `taken` holds.
    pub(crate) fn by_star(&self, taken: &[usize]) -> Vec<Vec<usize>> {
        let mut windows = vec![Vec::new(); self.stars];
        for &k in taken {
            for w in self.windows_of(k) {
                windows[self.star[w]].push(w);
            }
        }
        windows
    }

    /// Whether `at` lies on window `w` or within a pixel of it.
    pub(crate) fn near(&self, w: usize, at: [f64; 2]) -> bool {
        (0..2).all(|a| {
            let d = at[a] - self.corner[w][a];
            d > -1.5 && d < self.size[a] as f64 + 0.5
        })
    }

    /// Largest offset of a pixel from its star that an estimate has to cover, px.
    pub(crate) fn reach_px(&self) -> f64 {
        let largest = self.size[0].max(self.size[1]) as f64;
        let reach = (0..self.windows()).flat_map(|w| {
            (0..2).map(move |a| {
                let low = self.corner[w][a] - self.start[w][a];
                (-low).max(low + (self.size[a] - 1) as f64)
            })
        });
        // a centroid off its window is an error, not a wide spot
        reach.fold(0.0, f64::max).min(0.5 * largest + 1.5)
    }
}

/// Whether a position, px, is a number that a pixel may have.
pub(crate) fn on_a_detector(at: [f64; 2]) -> bool {
    at.iter().all(|v| v.abs() < MAX_PIXEL_INDEX)
}

/// Whether more than half of what is read out of a window has a value.
pub(crate) fn read_enough(values: impl Iterator<Item = f64>) -> bool {
    let [all, finite] = values.fold([0_usize; 2], |[all, finite], v| {
        [all + 1, finite + usize::from(v.is_finite())]
    });
    2 * finite > all
}

/// Numbers given to detector pixels in the order of their first appearance.
#[derive(Default)]
struct Pixels {
    origin: Option<[f64; 2]>,
    number: BTreeMap<[i64; 2], usize>,
    centre: Vec<[f64; 2]>,
}

impl Pixels {
    fn index(&mut self, corner: [f64; 2]) -> [i64; 2] {
        let origin = *self.origin.get_or_insert(corner);
        #[expect(
            clippy::cast_possible_truncation,
            reason = "positions beyond 10^6 px have been refused"
        )]
        let index = |a: usize| (corner[a] - origin[a]).round() as i64;
        [index(0), index(1)]
    }

    fn number(&mut self, key: [i64; 2]) -> usize {
        let origin = self.origin.unwrap_or_default();
        *self.number.entry(key).or_insert_with(|| {
            self.centre
                .push([origin[0] + key[0] as f64, origin[1] + key[1] as f64]);
            self.centre.len() - 1
        })
    }
}

/// Values by detector pixel, each less `level` of the values of its group that are
/// `taken`; a group without any keeps its values.
pub(crate) fn levelled(
    values: &[f64],
    group: &[usize],
    taken: &[bool],
    level: impl Fn(Vec<f64>) -> Option<f64>,
) -> Vec<f64> {
    let groups = group.iter().max().map_or(0, |g| g + 1);
    let mut members = vec![Vec::new(); groups];
    for p in (0..values.len()).filter(|&p| taken[p]) {
        members[group[p]].push(values[p]);
    }
    let levels: Vec<f64> = members
        .into_iter()
        .map(|m| level(m).unwrap_or(0.0))
        .collect();
    values
        .iter()
        .zip(group)
        .map(|(v, &g)| v - levels[g])
        .collect()
}

/// The mean, if there is anything to average.
pub(crate) fn mean(values: Vec<f64>) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Takes the weighted mean of its group off every value.
pub(crate) fn take_off_level(values: &mut [f64], group: &[usize], weights: &[f64]) {
    let groups = group.iter().max().map_or(0, |g| g + 1);
    let mut sums = vec![[0.0; 2]; groups];
    for ((v, w), &g) in values.iter().zip(weights).zip(group) {
        sums[g] = [sums[g][0] + w * v, sums[g][1] + w];
    }
    for (v, &g) in values.iter_mut().zip(group) {
        let [sum, weight] = sums[g];
        if weight > 0.0 {
            *v -= sum / weight;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(corner: [f64; 2], values: &[f64]) -> Entry<'_> {
        let at = [corner[0] + 1.0, corner[1] + 0.5];
        Entry {
            row: 0,
            t_s: 0.0,
            star: 0,
            start: at,
            flux: None,
            base: at,
            jacobian: [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0]],
            corner,
            background: 1.0,
            values,
        }
    }

    #[test]
    fn windows_that_jump_share_the_detector_pixels_they_overlap_on() {
        let values = [2.0, 3.0, 4.0, 5.0, 6.0, f64::NAN];
        for half in [0.0, 0.5] {
            let frames = vec![
                vec![entry([10.0 + half, -7.0 - half], &values)],
                Vec::new(),
                vec![
                    entry([11.0 + half, -7.0 - half], &values),
                    entry([f64::NAN, 0.0], &values),
                ],
            ];
            let mut unread = vec![false; 6];
            unread[0] = true;
            let sample = Sample::collect(1, [3, 2], &unread, &frames).unwrap();
            assert_eq!(sample.windows(), 2);
            assert_eq!(sample.windows_of(1), 1..1);
            assert_eq!(sample.cells, [[1, 0], [2, 0], [0, 1], [1, 1], [2, 1]]);
            // column 2 of the first window is column 1 of the second
            assert_eq!(sample.pixel[1], sample.pixel[5]);
            assert_eq!(
                sample.centre[sample.pixel[1]].map(f64::to_bits),
                [12.0 + half, -7.0 - half].map(f64::to_bits)
            );
            assert_eq!(
                sample.valid,
                [true, true, true, true, false, true, true, true, true, false]
            );
            // 2 + 3 + 4 + 5 above the background, scaled to 10^4
            assert!((sample.unit - 14.0 / FLUX_SCALE).abs() < 1e-15);
            assert!((sample.reach_px() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn dark_windows_are_no_sample() {
        let values = [0.0; 6];
        assert!(Sample::collect(1, [3, 2], &[], &[vec![entry([0.0, 0.0], &values)]]).is_none());
    }
}
