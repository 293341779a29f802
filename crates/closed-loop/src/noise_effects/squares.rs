//! Squares of the residuals over their usual size, and whether they follow a column.
//!
//! Squares over what is claimed of their variance, and over the own level of
//! every star, are 1 on average wherever one looks if the noise is the same. For a variable
//! with columns f, less their mean over each star's rows,
//!
//! ```text
//! z_i = q_i / (2 v_i L_star) - 1,   u = sum f_i z_i,   beta = N^-1 u,   N = sum f f'
//! T^2 = u' V^-1 u,  V = sum over blocks of time of (u_b - N_b beta)(...)',   and  u' N^-1 u / var z  ~ chi2
//! ```
//!
//! of which the larger chance counts.
//!
//! Source: Breusch & Pagan 1979, studentised by Koenker 1981; clusters as in Liang & Zeger 1986.

use block_regression::beyond;
use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use super::rows::{Row, Source};

/// A square beyond this many times the usual is a spike's.
pub(super) const SPIKE: f64 = 24.0;
/// Least rms of a column over the rows of a star, of 1: less is no change.
const LEAST_CHANGE: f64 = 0.05;
/// Fewest rows of a star with a level, and blocks of time.
pub(super) const MIN_ROWS: usize = 50;
const MIN_BLOCKS: usize = 10;
/// Variance of the logarithm of a median of n exponential numbers, times n: 1 / (ln 2)^2.
const OF_A_MEDIAN: f64 = 2.08;
/// Sigmas by which a star's level stands out.
const STANDS_OUT: f64 = 3.0;

/// A chance, and the rms share of the variance that changes.
pub(super) type Judged = [f64; 2];

/// What a chance of the changes is raised to, so that it says what all of the residual would: each residual less the mean
/// of its neighbours, whose squares of white noise are alike by (2/3)^2 and (1/6)^2 over one and two frames, tells
/// 1 / (1 + 2 (4/9 + 1/36)) = 0.51 of what squares do; of that, 0.67 is asked for.
const OF_CHANGES: f64 = 1.5;

/// What all residuals tell, as far as what changes from frame to frame tells the same.
pub(super) fn both(all: Option<Judged>, fast: Option<Judged>) -> Option<Judged> {
    let (all, fast) = (all?, fast?);
    Some([all[0].max(fast[0].powf(OF_CHANGES)), all[1]])
}

/// Whose square it is, and when.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    /// Its place among all rows.
    pub(super) at: usize,
    /// The star, or whatever else has a level of its own.
    pub(super) star: usize,
    pub(super) block: usize,
}

impl From<&Row> for Place {
    fn from(row: &Row) -> Self {
        Self {
            at: row.at,
            star: row.star,
            block: row.block,
        }
    }
}

/// Squares over their usual size.
pub(super) struct Table {
    pub(super) rows: Vec<Place>,
    /// Of each row, over the level of its star.
    pub(super) relative: Vec<f64>,
    pub(super) stars: Vec<StarLevel>,
    pub(super) blocks: usize,
}

/// What a table knows of a star.
#[derive(Clone, Copy, Debug)]
pub(super) struct StarLevel {
    /// Its variance over the declared one.
    pub(super) level: f64,
    pub(super) rows: usize,
    /// Variance of the sum of its rows' half squares over their noise's.
    pub(super) scatter: f64,
    /// Magnitude - 5.
    pub(super) mag: f64,
}

impl StarLevel {
    pub(super) const UNSEEN: Self = Self {
        level: 0.0,
        rows: 0,
        scatter: 0.0,
        mag: f64::NAN,
    };
}

/// A variable in the rows of a table.
pub(super) struct Columns {
    pub(super) rows: Vec<[f64; 2]>,
    /// Over the rows of each star.
    pub(super) mean: Vec<[f64; 2]>,
}

impl Columns {
    pub(super) fn of(table: &Table, column: impl Fn(&Place) -> [f64; 2]) -> Self {
        let rows: Vec<[f64; 2]> = table.rows.iter().map(column).collect();
        let mut mean = vec![[0.0; 2]; table.stars.len()];
        for (row, f) in table.rows.iter().zip(&rows) {
            let count = table.stars[row.star].rows as f64;
            for k in 0..2 {
                mean[row.star][k] += f[k] / count;
            }
        }
        Self { rows, mean }
    }
}

/// u and N of some columns.
#[derive(Clone)]
pub(super) struct Scores {
    pub(super) score: DVector<f64>,
    pub(super) normal: DMatrix<f64>,
}

impl Scores {
    pub(super) fn zeros(count: usize) -> Self {
        Self {
            score: DVector::zeros(count),
            normal: DMatrix::zeros(count, count),
        }
    }
}

/// What the rows of a star show.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelShown {
    /// Its level; `None` where they are too few.
    pub(super) level: Option<f64>,
    rows: usize,
}

/// What each of so many stars shows in `rows` that are not marked, over their `variance`; spikes tell nothing.
pub(super) fn levels_shown(
    rows: &[Row],
    stars: usize,
    variance: impl Fn(&Row) -> f64,
) -> Vec<LevelShown> {
    let mut levels = vec![Vec::new(); stars];
    for row in rows.iter().filter(|r| !r.marked) {
        levels[row.star].push(row.level_over(variance(row)));
    }
    let each = levels.iter_mut().map(|levels| LevelShown {
        level: spectra::robust::median(levels).filter(|_| levels.len() >= MIN_ROWS),
        rows: levels.len(),
    });
    each.collect()
}

/// Levels of stars, by which their rows are weighed, from what so many rows of each show: all alike but those that
/// stand out, by as much as they do. A star that is quiet by chance turned its frames to itself if it were believed,
/// and was quieter still: levels of four stars a frame scattered twice as much as their rows.
fn believed(shown: &[LevelShown]) -> Option<Vec<f64>> {
    let known = shown.iter().filter_map(|s| s.level);
    let mut known: Vec<f64> = known.filter(|l| *l > 0.0).collect();
    let usual = spectra::robust::median(&mut known)?;
    let each = shown.iter().map(|&LevelShown { level, rows }| {
        let off = level.map_or(0.0, |level| (level / usual).ln());
        let chance = STANDS_OUT * STANDS_OUT * OF_A_MEDIAN / rows as f64;
        if off * off > chance && off.is_finite() {
            usual * (off - chance / off).exp()
        } else {
            usual
        }
    });
    Some(each.collect())
}

impl Table {
    pub(super) fn new(source: &Source<'_>) -> Option<Self> {
        let stars = source.data.stars.len();
        let of = |believed: &[f64]| {
            let rows = source.rows(&|row: &Row| [row.declared * believed[row.star], 1.0]);
            let shown = levels_shown(&rows, stars, |row| row.declared);
            (rows, shown)
        };
        let (_, first) = of(&vec![1.0; stars]);
        let (mut rows, shown) = of(&believed(&first)?);
        rows.retain(|r| {
            let sound = |level: f64| level > 0.0 && r.square < SPIKE * r.declared * level;
            !r.marked && shown[r.star].level.is_some_and(sound)
        });
        let mut sums = vec![StarLevel::UNSEEN; stars];
        for row in &rows {
            let sum = &mut sums[row.star];
            sum.level += 0.5 * row.square / row.declared;
            sum.rows += 1;
            sum.scatter += row.variance();
            sum.mag = row.mag;
        }
        for sum in &mut sums {
            sum.level /= sum.rows.max(1) as f64;
        }
        let relative = rows
            .iter()
            .map(|r| 0.5 * r.square / r.declared / sums[r.star].level - 1.0)
            .collect();
        Some(Self {
            relative,
            stars: sums,
            blocks: rows.iter().map(|r| r.block + 1).max()?,
            rows: rows.iter().map(Place::from).collect(),
        })
    }

    /// A variable that changes while a star is seen, by the first `count` of its columns.
    pub(super) fn within(&self, columns: &Columns, count: usize) -> Option<Judged> {
        let mut of_block = vec![Scores::zeros(count); self.blocks];
        for ((row, f), z) in self.rows.iter().zip(&columns.rows).zip(&self.relative) {
            let mean = columns.mean[row.star];
            let Scores { score, normal } = &mut of_block[row.block];
            for i in 0..count {
                let own = f[i] - mean[i];
                score[i] += own * z;
                for j in 0..count {
                    normal[(i, j)] += own * (f[j] - mean[j]);
                }
            }
        }
        self.judge(of_block)
    }

    /// What the blocks of time tell of some columns.
    pub(super) fn judge(&self, mut of_block: Vec<Scores>) -> Option<Judged> {
        of_block.retain(|b| b.score.norm_squared() > 0.0);
        let count = of_block.first()?.score.len();
        let mut all = Scores::zeros(count);
        for block in &of_block {
            all.score += &block.score;
            all.normal += &block.normal;
        }
        let Scores { score, normal } = all;
        let n = self.rows.len() as f64;
        if (0..count).any(|k| normal[(k, k)] < n * LEAST_CHANGE * LEAST_CHANGE) {
            return None;
        }
        let beta = Cholesky::new(normal)?.solve(&score);
        let square = self.relative.iter().map(|z| z * z).sum::<f64>();
        let white = beta.dot(&score) / (square / n).max(1.0);
        let k = count as f64;
        let p_white = ChiSquared::new(k).ok()?.sf(white);
        let blocks = of_block.len() as f64;
        if of_block.len() < MIN_BLOCKS {
            return None;
        }
        // what the fit leaves of the blocks: what it takes is no scatter
        let spread: DMatrix<f64> = of_block
            .iter()
            .map(|b| &b.score - &b.normal * &beta)
            .map(|left| &left * left.transpose())
            .fold(DMatrix::zeros(count, count), |a, b| a + b);
        let covariance = spread * (blocks / (blocks - k));
        let square = score.dot(&Cholesky::new(covariance)?.solve(&score));
        let law = FisherSnedecor::new(k, blocks - k).ok()?;
        let p = beyond(&law, square / k);
        Some([p.max(p_white), (beta.dot(&score).max(0.0) / n).sqrt()])
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::star::harness::{STARS, seen};
    use block_regression::Folds;
    use focal_plane::{AttitudeSeries, Camera, StarFrames};
    use nalgebra::UnitQuaternion;
    use rand_core::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_xoshiro::Xoshiro256PlusPlus;

    /// One star over twelve blocks of 200 rows, whose level goes with the time from -1 to 1, which is in the columns.
    pub(in crate::noise_effects) fn in_time(level: impl Fn(f64) -> f64) -> (Table, Columns) {
        let mut state = 7_u64;
        let mut table = Table {
            rows: Vec::new(),
            relative: Vec::new(),
            stars: vec![StarLevel {
                level: 1.0,
                rows: 2400,
                scatter: 2400.0,
                mag: 0.0,
            }],
            blocks: 12,
        };
        let mut columns = Columns {
            rows: Vec::new(),
            mean: vec![[0.0; 2]],
        };
        for k in 0..2400_usize {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            let uniform = ((state >> 11) as f64 + 0.5) / (1_u64 << 53) as f64;
            let t = k as f64 / 1200.0 - 1.0;
            table.rows.push(Place {
                at: k,
                star: 0,
                block: k / 200,
            });
            // half a square of two axes is exponential
            table.relative.push(-uniform.ln() * level(t) - 1.0);
            columns.rows.push([t, 0.0]);
        }
        (table, columns)
    }

    /// Levels of six stars, four of them a frame, in 900 frames of white noise, in sigmas of their rows.
    fn four_a_frame(seed: u64) -> Vec<f64> {
        let mut rng = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut one = || -> f64 { StandardNormal.sample(&mut rng) };
        let camera = Camera::from_fov_deg([1024, 1024], [20.0, 20.0]).unwrap();
        let (mut frames, mut t_s) = (StarFrames::new(), Vec::new());
        for k in 0..900_usize {
            frames.begin(k as f64);
            t_s.push(k as f64);
            let missing = [k % 6, (k + 1 + k / 6 % 5) % 6];
            for (s, [x, y]) in (0_u8..).zip(STARS) {
                if !missing.contains(&usize::from(s)) {
                    frames.push(i32::from(s), i64::from(s), x, y);
                }
            }
        }
        let still = vec![UnitQuaternion::identity(); t_s.len()];
        let reference = AttitudeSeries::new(t_s, still, None).unwrap();
        let data = seen(&camera, &frames, Some(&reference), &STARS);
        let rows = data.t_s.len();
        let mut white = || (0..rows).map(|_| one()).collect::<Vec<f64>>();
        let residual = [white(), white()];
        let table = Table::new(&Source {
            data: &data,
            residual: &residual,
            declared: &vec![1.0; rows],
            rate: &vec![0.0; rows],
            folds: &Folds::cut(data.frames.frames()),
        });
        let stars = table.unwrap().stars;
        let each = stars.iter();
        each.map(|s| (s.level - 1.0) * s.rows as f64 / s.scatter.sqrt())
            .collect()
    }

    /// A frame of four stars leaves five numbers of eight, which its stars share: their levels scatter by little more
    /// than rows by themselves. Of 240 levels the rms is known to 0.05; believed as they are, they scatter by 1.37.
    #[test]
    fn stars_that_are_quiet_by_chance_are_not_believed() {
        let z: Vec<f64> = (0..40).flat_map(four_a_frame).collect();
        let rms = (z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64).sqrt();
        assert!((0.85..1.15).contains(&rms), "{rms}");
        let shown = [1.1, 1.0, 0.9, 4.0].map(|level| LevelShown {
            level: Some(level),
            rows: 400,
        });
        let [one, _, _, loud] = believed(&shown).unwrap()[..] else {
            panic!("four stars")
        };
        assert!(one < 1.06 && loud > 3.8, "{one} {loud}");
    }

    /// Chance of a slope in time of the noise; `rise`: by how much the squares grow from the middle to an end.
    fn chance_in_time(rise: f64) -> f64 {
        let (table, columns) = in_time(|t| 1.0 + rise * t);
        table.within(&columns, 1).unwrap()[0]
    }

    /// A rise of 0.5 is known to sqrt(3 / 2400) = 0.035: 14 sigma. Scores of the blocks grow with the square of
    /// the time, which is what they follow and no scatter.
    #[test]
    fn noise_that_grows_is_seen_in_a_dozen_blocks() {
        assert!(chance_in_time(0.5) < 1e-6, "{}", chance_in_time(0.5));
        assert!(chance_in_time(0.0) > 0.01, "{}", chance_in_time(0.0));
    }
}
