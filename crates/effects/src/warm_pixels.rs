//! Where a warm pixel may be: one look at all pixels under the stars.
//!
//! ```text
//! z(H) = sum w^2 c r / sqrt(sum w^2 c c)      c = H - P while |c| <= 1.5 px on both axes,  r what is left there
//! ```
//!
//! over the rows near a pixel of middle H: what one coefficient would gain, in units of the noise. What is
//! constant for a star may be the catalogue's or the lens', so that z is also taken with the mean of c and
//! r over each star's own rows there taken off, and the larger counts. A warm pixel pulls toward itself:
//! z is positive. The best are proposed, and stand for all that were looked at.
//!
//! Source: the score of a linear coefficient at zero (Rao 1948).

use std::collections::{BTreeMap, HashMap};

use focal_plane::{Camera, Pixel};
use rayon::prelude::*;

use crate::StarRows;
use crate::hot_pixel::{HALF_WIDTH_PX, middle_of, pixel_of};

/// Pixels that are proposed, of those that a star was in and of those that stars only passed by.
const MOST_PIXELS: [usize; 2] = [40, 8];
/// Rows within half-width of a pixel with which it is worth looking at: with fewer, the pixels of a slew are
/// so many that all effects pay for them.
const LEAST_ROWS: u32 = 8;
/// Share of the squared pull that changes while stars pass by a pixel that none is in: 0.25 of a star that moves along
/// the edge of its reach.
const SWEPT: f64 = 0.2;
/// Pixels within whose half-width a star may be: its own and those around.
const NEAR: [[i64; 2]; 9] = [
    [-1, -1],
    [0, -1],
    [1, -1],
    [-1, 0],
    [0, 0],
    [1, 0],
    [-1, 1],
    [0, 1],
    [1, 1],
];

/// The pixels that are proposed, best first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WarmPixels {
    /// Those that are proposed.
    pub(crate) proposed: Vec<WarmPixel>,
    /// How many were looked at for each, whether stars were in them or beside them.
    pub(crate) stand_for: [f64; 2],
}

/// A pixel that may be warm.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct WarmPixel {
    pub(crate) middle: Pixel,
    /// Whether stars pass by it: for half of what is seen near it by stars that are elsewhere for half of their time.
    /// What pulls at a star that rests is a constant of that star's own.
    pub(crate) passed: bool,
    /// Whether stars were beside it, and none was in it.
    pub(crate) beside: bool,
}

/// Weighted sums over the rows of one star near one pixel.
#[derive(Clone, Copy, Default)]
struct Sums {
    weight: f64,
    c: [f64; 2],
    r: [f64; 2],
    cr: f64,
    cc: f64,
}

/// Rows that follow one another in which a star is in the same pixel.
struct Visit<'a> {
    pixel: [i64; 2],
    rows: &'a [usize],
}

impl WarmPixels {
    /// Looks at all pixels under `rows`, of which `left_px` is left (x, y), with these weights; a row of
    /// weight 0 does not count.
    ///
    /// # Panics
    /// When the lengths differ.
    pub fn look(
        camera: &Camera,
        rows: &StarRows<'_>,
        left_px: [&[f64]; 2],
        weight: &[f64],
    ) -> Self {
        assert!(left_px.iter().all(|l| l.len() == rows.len()), "residuals");
        assert_eq!(weight.len(), rows.len(), "weights");
        // star by star, for which hardly any row lies in another pixel than the one before
        let mut of_star: BTreeMap<i64, Vec<usize>> = BTreeMap::new();
        for i in (0..rows.len()).filter(|&i| weight[i] > 0.0) {
            of_star.entry(rows.star_id[i]).or_default().push(i);
        }
        let stars: Vec<Vec<usize>> = of_star.into_values().collect();
        let look = Look {
            camera,
            rows,
            left_px,
            weight,
        };
        let each: Vec<Vec<Visit<'_>>> = stars.par_iter().map(|own| look.visits(own)).collect();
        let mut visits: HashMap<[i64; 2], u32> = HashMap::new();
        for visit in each.iter().flatten() {
            let count = u32::try_from(visit.rows.len()).unwrap_or(u32::MAX);
            *visits.entry(visit.pixel).or_default() += count;
        }
        let near = |[x, y]: [i64; 2]| -> u32 {
            let of = |[i, j]: &[i64; 2]| visits.get(&[x + i, y + j]).copied();
            NEAR.iter().filter_map(of).sum()
        };
        let around = |[x, y]: &[i64; 2]| NEAR.map(|[i, j]| [x + i, y + j]);
        let mut pixels: Vec<[i64; 2]> = visits.keys().flat_map(around).collect();
        pixels.sort_unstable();
        pixels.dedup();
        let pixels: Vec<([i64; 2], u32)> = pixels
            .into_par_iter()
            .filter(|pixel| near(*pixel) >= LEAST_ROWS)
            .map(|pixel| (pixel, visits.get(&pixel).copied().unwrap_or(0)))
            .collect();
        let index: HashMap<[i64; 2], usize> =
            pixels.iter().enumerate().map(|(k, p)| (p.0, k)).collect();
        let sums: Vec<_> = each
            .par_iter()
            .map(|own| look.sums(own, &pixels, &index))
            .collect();
        let mut whole = vec![[Sums::default(); 2]; pixels.len()];
        // near each pixel: all, and of stars that pass by
        let mut seen = vec![[0.0; 2]; pixels.len()];
        for (visits, of_star) in each.iter().zip(&sums) {
            let rows = visits.iter().flat_map(|visit| visit.rows);
            let all: f64 = rows.map(|&i| weight[i] * weight[i]).sum();
            for (p, own) in of_star {
                whole[*p][0].join(own);
                whole[*p][1].join(&own.centred());
                seen[*p][0] += own.weight;
                if own.weight <= 0.5 * all {
                    seen[*p][1] += own.weight;
                }
            }
        }
        let mut ranked: Vec<(f64, usize)> = whole
            .iter()
            .map(|both| both.each_ref().map(Sums::score))
            .map(|[plain, centred]| plain.max(centred))
            .zip(0..)
            .collect();
        // ties go to the longer visit, then to the lower coordinates
        ranked.sort_by(|a, b| {
            let visits = |k: usize| pixels[k].1;
            let longer = visits(b.1).cmp(&visits(a.1));
            b.0.total_cmp(&a.0).then(longer).then(a.1.cmp(&b.1))
        });
        let passed = |k: usize| seen[k][1] >= 0.5 * seen[k][0];
        // what pulls from beside at a star that rests is a constant of it for a while
        let sweeps = |k: usize| passed(k) && whole[k][1].cc >= SWEPT * whole[k][0].cc;
        let [within, beside]: [Vec<usize>; 2] = [false, true].map(|beside| {
            let all = ranked.iter().map(|(_, k)| *k);
            all.filter(|k| (pixels[*k].1 == 0) == beside && (!beside || sweeps(*k)))
                .collect()
        });
        let pixel = |&k: &usize| WarmPixel {
            middle: middle_of(camera, pixels[k].0),
            passed: passed(k),
            beside: pixels[k].1 == 0,
        };
        let mut out = Self::default();
        for (class, looked_at) in [within, beside].iter().enumerate() {
            let proposed = &looked_at[..looked_at.len().min(MOST_PIXELS[class])];
            out.proposed.extend(proposed.iter().map(pixel));
            out.stand_for[class] = looked_at.len() as f64 / proposed.len().max(1) as f64;
        }
        out
    }
}

/// What is looked at.
struct Look<'a> {
    camera: &'a Camera,
    rows: &'a StarRows<'a>,
    left_px: [&'a [f64]; 2],
    weight: &'a [f64],
}

impl Look<'_> {
    /// Where a star is in these rows of it.
    fn visits<'a>(&self, own: &'a [usize]) -> Vec<Visit<'a>> {
        let pixel = |&i: &usize| pixel_of(self.camera, self.rows.landed(i));
        own.chunk_by(|a, b| pixel(a) == pixel(b))
            .map(|rows| Visit {
                pixel: pixel(&rows[0]),
                rows,
            })
            .collect()
    }

    /// Sums of a star over its visits, for those of `pixels` that it comes near, whose places are in `index`.
    fn sums(
        &self,
        own: &[Visit<'_>],
        pixels: &[([i64; 2], u32)],
        index: &HashMap<[i64; 2], usize>,
    ) -> Vec<(usize, Sums)> {
        let mut out: Vec<(usize, Sums)> = Vec::new();
        let mut place: HashMap<usize, usize> = HashMap::new();
        for Visit { pixel, rows } in own {
            let near = NEAR.map(|[x, y]| {
                let p = *index.get(&[pixel[0] + x, pixel[1] + y])?;
                Some(*place.entry(p).or_insert_with(|| {
                    out.push((p, Sums::default()));
                    out.len() - 1
                }))
            });
            for &i in *rows {
                let at = self.rows.landed(i);
                for k in near.into_iter().flatten() {
                    let (p, sums) = &mut out[k];
                    let middle = middle_of(self.camera, pixels[*p].0);
                    let c = [middle.x - at.x, middle.y - at.y];
                    if c.iter().all(|c| c.abs() <= HALF_WIDTH_PX) {
                        let weight = self.weight[i] * self.weight[i];
                        sums.add(c, self.left_px.map(|l| l[i]), weight);
                    }
                }
            }
        }
        out
    }
}

impl Sums {
    fn add(&mut self, c: [f64; 2], r: [f64; 2], w: f64) {
        if r.iter().any(|r| !r.is_finite()) {
            return;
        }
        self.weight += w;
        for axis in 0..2 {
            self.c[axis] += w * c[axis];
            self.r[axis] += w * r[axis];
            self.cr += w * c[axis] * r[axis];
            self.cc += w * c[axis] * c[axis];
        }
    }

    /// The same about the means.
    fn centred(&self) -> Self {
        let mut out = *self;
        if self.weight > 0.0 {
            for axis in 0..2 {
                out.cr -= self.c[axis] * self.r[axis] / self.weight;
                out.cc -= self.c[axis] * self.c[axis] / self.weight;
            }
        }
        out
    }

    fn join(&mut self, other: &Self) {
        self.cr += other.cr;
        self.cc += other.cc;
    }

    fn score(&self) -> f64 {
        // what a star at rest leaves of its mean is rounding
        if self.cc > 1e-9 {
            self.cr / self.cc.sqrt()
        } else {
            0.0
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WARM: Pixel = Pixel { x: 30.5, y: 21.5 };
    /// The star that passes by the warm one comes no nearer than 0.6 px.
    const BESIDE: Pixel = Pixel { x: 30.5, y: 22.5 };

    /// Twelve stars that drift over some 240 pixels, by `pace` px a frame.
    fn drifting(pace: f64) -> Vec<(i64, [f64; 2])> {
        let frames = (0..).take_while(|k| f64::from(*k) * pace < 120.0);
        let each = frames.flat_map(|k| {
            let t = f64::from(k) * pace;
            (0..12_i64).map(move |s| {
                let at = [
                    10.2 + t + 0.3 * (s as f64),
                    20.7 + 0.05 * t - 40.0 * (s as f64),
                ];
                (s, at)
            })
        });
        each.collect()
    }

    /// Stars at these places under noise of 0.02 px, with a `warm` pixel of this `strength`; and the same where it
    /// pushes.
    fn looked(warm: Pixel, places: &[(i64, [f64; 2])], strength: f64) -> [WarmPixels; 2] {
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let mut state = 9_u64;
        let mut noise = || {
            let sum: f64 = (0..12)
                .map(|_| {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1);
                    (state >> 33) as f64 / f64::from(1_u32 << 31)
                })
                .sum();
            0.02 * (sum - 6.0)
        };
        let (mut x, mut y, mut left, mut star) = (vec![], vec![], [vec![], vec![]], vec![]);
        for (s, at) in places {
            let c = [warm.x - at[0], warm.y - at[1]];
            let near = c.iter().all(|c| c.abs() <= 1.5);
            for axis in 0..2 {
                let pull = if near { strength * c[axis] } else { 0.0 };
                left[axis].push(pull + noise());
            }
            x.push(at[0]);
            y.push(at[1]);
            star.push(*s);
        }
        let n = x.len();
        let (none, slot) = (vec![0.0; n], vec![0; n]);
        let rows = StarRows {
            t_s: &none,
            x_px: &x,
            y_px: &y,
            landed_px: [&x, &y],
            landed_variance_px2: [&none, &none],
            vx_px_s: &none,
            vy_px_s: &none,
            ax_px_s2: &none,
            ay_px_s2: &none,
            mag: &none,
            bv: &none,
            log_flux: &none,
            log_flux_change: &none,
            window_px: [&none, &none],
            slot: &slot,
            star_id: &star,
            waves: None,
            attitude: None,
        };
        let look = |left: [&[f64]; 2]| WarmPixels::look(&camera, &rows, left, &vec![1.0; n]);
        let away = [0, 1].map(|a| left[a].iter().map(|v| -v).collect::<Vec<f64>>());
        [look([&left[0], &left[1]]), look([&away[0], &away[1]])]
    }

    /// One pixel is warm and visited no longer than others; its pull, 0.02 of up to 1.5 px, is six sigma (a
    /// mean of 0.012 px over two axes of 60 rows). In the first places it is, although the star has an offset of
    /// its own that is as large.
    #[test]
    fn a_warm_pixel_is_looked_at_first_however_short_its_visit() {
        let [found, pushed] = looked(WARM, &drifting(0.05), 0.02);
        let [within, _] = found.stand_for;
        assert!(within * MOST_PIXELS[0] as f64 > 1000.0, "{within}");
        assert_eq!(found.proposed.len(), MOST_PIXELS[0] + MOST_PIXELS[1]);
        let first = found.proposed[0];
        assert_eq!(first.middle, WARM, "{:?}", &found.proposed[..4]);
        assert!(first.passed, "stars drift by");
        // a pixel that pushes is none
        let is_warm = |p: &WarmPixel| p.middle == WARM;
        assert!(!pushed.proposed[..8].iter().any(is_warm));
    }

    /// Four rows fall in each pixel, twelve within its half-width: enough for a pull of 0.06 of up to 1.5 px,
    /// nine sigma.
    #[test]
    fn rows_around_a_pixel_count_not_those_in_it() {
        let [found, _] = looked(WARM, &drifting(0.25), 0.06);
        assert_eq!(found.proposed[0].middle, WARM, "{:?}", &found.proposed[..4]);
    }

    /// Each star drifts along a row of pixels and has another on either side, in which it is not. A warm one of these
    /// is the first of them, and pays for them alone.
    #[test]
    fn pixels_that_stars_only_pass_by_are_looked_at() {
        let [found, _] = looked(BESIDE, &drifting(0.05), 0.04);
        let beside: Vec<&WarmPixel> = found.proposed.iter().filter(|p| p.beside).collect();
        assert_eq!(beside.len(), MOST_PIXELS[1]);
        assert_eq!(beside[0].middle, BESIDE, "{:?}", &beside[..4]);
        let [within, outside] = found.stand_for;
        let looked_at = [
            within * MOST_PIXELS[0] as f64,
            outside * MOST_PIXELS[1] as f64,
        ];
        assert!(
            looked_at[1] > 1.5 * looked_at[0] && looked_at[1] < 2.5 * looked_at[0],
            "{looked_at:?}"
        );
        let own = found.proposed.iter().find(|p| p.middle == WARM);
        assert!(own.is_none_or(|p| !p.beside), "a star is in it");
    }

    /// A star that rests beside a pixel for a while, and then elsewhere, is off by a constant for that while.
    #[test]
    fn a_star_that_rests_beside_a_pixel_does_not_pass_by() {
        let rests = |place: [f64; 2]| (0..200).map(move |_| (3, place));
        let places: Vec<_> = rests([30.5, 21.7]).chain(rests([60.5, 61.5])).collect();
        let [found, _] = looked(BESIDE, &places, 0.1);
        let own = |p: &&WarmPixel| p.middle == WARM;
        assert!(found.proposed.iter().find(own).is_some_and(|p| p.passed));
        assert!(
            !found.proposed.iter().any(|p| p.beside),
            "{:?}",
            found.proposed
        );
    }
}
