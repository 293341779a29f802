//! Which stars and pixels the residual of the declared model points at.
//!
//! Thousands of pixels lie under the stars, and a tracker that spins passes thousands of stars: each as a
//! candidate of its own would cost memory and time with the square of their number. So all are looked at
//! once, and those that gain most by themselves are proposed; each pays for all that it was picked from
//! ([`Candidate::stands_for`](effects::Candidate::stands_for)). Of a star
//!
//! ```text
//! remarkable = ((sum w^2 r_x)^2 + (sum w^2 r_y)^2) / sum w^2        r: its residuals,  w: their weights
//! ```
//!
//! Source: the score of a constant at zero (Rao 1948).

use effects::{StarFacts, StarRows, WarmPixels};

use crate::evidence::Residuals;
use crate::star::data::StarData;

/// What is left of each row, px, and how much it counts.
pub(crate) struct Pointed<'a> {
    data: &'a StarData,
    left_px: [Vec<f64>; 2],
    weight: Vec<f64>,
}

impl<'a> Pointed<'a> {
    /// What the declared model leaves; outliers do not count.
    pub(crate) fn of(data: &'a StarData, before: &Residuals, weight: &[f64]) -> Self {
        let scale = data.camera.arcsec_per_px();
        let left_px =
            std::array::from_fn(|a| before.axes[a].iter().map(|r| r / scale[a]).collect());
        let counts = data.outlier.iter().zip(weight);
        Self {
            data,
            left_px,
            weight: counts.map(|(o, w)| if *o { 0.0 } else { *w }).collect(),
        }
    }

    /// All stars, with how remarkable each is.
    pub(crate) fn stars(&self) -> Vec<StarFacts> {
        let mut sums = vec![[0.0; 3]; self.data.stars.len()];
        for (row, &star) in self.data.star.iter().enumerate() {
            let [x, y] = self.left_px.each_ref().map(|l| l[row]);
            let w = self.weight[row] * self.weight[row];
            if w > 0.0 && x.is_finite() && y.is_finite() {
                let [sx, sy, all] = &mut sums[star];
                *sx += w * x;
                *sy += w * y;
                *all += w;
            }
        }
        let remarkable = |[x, y, all]: [f64; 3]| {
            if all > 0.0 {
                (x * x + y * y) / all
            } else {
                0.0
            }
        };
        let stars = self.data.stars.iter().zip(sums);
        stars
            .map(|(s, sums)| StarFacts {
                star_id: s.id,
                mag: s.mag,
                bv: s.bv,
                remarkable: remarkable(sums),
            })
            .collect()
    }

    /// Where a warm pixel may be.
    pub(crate) fn pixels(&self, rows: &StarRows<'_>) -> WarmPixels {
        let [x, y] = &self.left_px;
        WarmPixels::look(&self.data.camera, rows, [x, y], &self.weight)
    }
}
