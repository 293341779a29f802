//! What enters or leaves a choice as one.
//!
//! Not physics: which columns belong together, and which stand in each other's place.

use block_regression::Estimate;

/// Candidate columns that enter or leave together.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Group {
    /// Positions among the candidate columns; those that the data cannot show are
    /// not among them.
    pub(crate) columns: Vec<usize>,
    /// Least and largest credible amplitude of each of `columns`.
    pub(crate) bounds: Vec<[f64; 2]>,
    /// Choices among discrete forms that the group stands for, each paid for like
    /// a parameter.
    pub(crate) choices: usize,
    /// How many of its first columns turn the camera about X and Y, where the others turn it about the boresight, which
    /// stars tell ten times worse: as much about each axis shows across the boresight alone. 0: it is not so divided.
    pub(crate) across: usize,
    /// Parameters that the columns follow non-linearly, found by scanning.
    pub(crate) shapes: usize,
    /// Columns that are slopes of such parameters.
    pub(crate) slopes: usize,
    /// Groups of one family are forms of one cause, or of one part of it: at most one is chosen, but for those that
    /// act apart.
    pub(crate) family: String,
    /// Middle and half-width, px, where it acts on a part of the detector alone.
    pub(crate) reach: Option<([f64; 2], f64)>,
    /// Groups of one kind are one effect, whatever it acts on.
    pub(crate) kind: &'static str,
    /// How many of its kind were looked at for each that is tried.
    pub(crate) stands_for: f64,
    /// How likely it is beside the others of its kind, of 1.
    pub(crate) credit: f64,
}

impl Group {
    /// Whether what `estimate` says of `columns`, some of its own, from its parameter `first` on, is all credible.
    pub(crate) fn believes(&self, columns: &[usize], estimate: &Estimate, first: usize) -> bool {
        columns.iter().zip(first..).all(|(column, i)| {
            let at = self.columns.iter().position(|c| c == column);
            at.is_none_or(|k| is_believed(estimate, i, self.bounds[k]))
        })
    }

    /// Whether a size that is believed could show in data that tell its columns, parameters from `first` on, so well: one
    /// that is no sigma for any of them is lost in the noise.
    pub(crate) fn could_show(&self, estimate: &Estimate, first: usize) -> bool {
        let mut each = self.bounds.iter().zip(first..);
        each.any(|(bounds, i)| estimate.sigma(i) <= largest(*bounds))
    }

    /// Whether not both are chosen: forms of one cause, of which two pixels that no star is near at once are none.
    pub(crate) fn excludes(&self, other: &Self) -> bool {
        let apart = self.reach.zip(other.reach).is_some_and(|((a, r), (b, s))| {
            let [x, y] = [0, 1].map(|axis| (a[axis] - b[axis]).abs());
            x.max(y) > r + s
        });
        self.family == other.family && !apart
    }
}

/// The largest believed size, whatever its sign.
pub(crate) fn largest([low, high]: [f64; 2]) -> f64 {
    low.abs().max(high.abs())
}

/// Sigmas by which an estimate may lie beyond what is credible: the size itself may be as large.
const BEYOND: f64 = 2.0;

/// Whether parameter `i` may be within these bounds. A bound at zero is one of sign: what is beyond chance beyond it
/// is no size of the same.
pub(crate) fn is_believed(estimate: &Estimate, i: usize, [low, high]: [f64; 2]) -> bool {
    let off = BEYOND * estimate.sigma(i);
    let [below, above] = [low, high].map(|bound| if bound == 0.0 { 0.0 } else { off });
    (low - below..=high + above).contains(&estimate.value[i])
}

/// Whether group `g` may be chosen beside these.
pub(crate) fn open_beside(groups: &[Group], chosen: &[usize], g: usize) -> bool {
    chosen.iter().all(|&c| !groups[c].excludes(&groups[g]))
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::*;

    fn group(family: &str, reach: Option<([f64; 2], f64)>) -> Group {
        Group {
            columns: vec![4, 6],
            bounds: vec![[-1.0, 1.0], [0.0, 2.0]],
            choices: 0,
            across: 0,
            shapes: 0,
            slopes: 0,
            family: family.to_owned(),
            reach,
            kind: "hot_pixel",
            stands_for: 1.0,
            credit: 1.0,
        }
    }

    /// A size within two sigmas (of 0.05) of its bound is believed, one beyond not, and none beyond one of sign; what
    /// the group does not have has no bound.
    #[test]
    fn sizes_within_their_bounds_are_believed() {
        let group = group("", None);
        for (columns, sizes, believed) in [
            (&[4, 6][..], &[-1.0, 2.0][..], true),
            (&[4, 6], &[1.09, 2.09], true),
            (&[6], &[1.5], true),
            (&[4], &[1.11], false),
            (&[4], &[-1.11], false),
            (&[6, 4], &[-0.01, 0.5], false),
            (&[5], &[9.0], true),
        ] {
            let known = DMatrix::identity(sizes.len(), sizes.len()) * 0.05 * 0.05;
            let estimate = Estimate {
                value: DVector::from_column_slice(sizes),
                covariance: known.clone(),
                white: known,
                blocks: 60.0,
            };
            assert_eq!(
                group.believes(columns, &estimate, 0),
                believed,
                "{columns:?} {sizes:?}"
            );
        }
    }

    /// A sigma as large as the largest believed size shows none of them.
    #[test]
    fn what_no_believed_size_would_show_cannot_show() {
        let known = |sigma: f64| Estimate {
            value: DVector::zeros(2),
            covariance: DMatrix::identity(2, 2) * sigma * sigma,
            white: DMatrix::identity(2, 2) * sigma * sigma,
            blocks: 60.0,
        };
        // bounds of 1 and 2
        assert!(group("", None).could_show(&known(1.9), 0));
        assert!(!group("", None).could_show(&known(2.1), 0));
    }

    /// Pixels on two sides of a star are forms of one pull; those that no star is near at once are two.
    #[test]
    fn what_acts_apart_is_no_other_form() {
        let pixel = |x: f64| group("hot_pixel", Some(([x, 20.0], 1.5)));
        assert!(pixel(10.0).excludes(&pixel(13.0)));
        assert!(!pixel(10.0).excludes(&pixel(13.5)));
        assert!(group("a", None).excludes(&group("a", None)));
        assert!(!group("a", None).excludes(&group("b", None)));
    }
}
