//! What the others know of a fold in pieces.
//!
//! Directions of stars in frames with attitudes of their own are told one by another alone. Where a field turns through
//! many stars, a fold that is held out cuts those before it from those after it: of how the two turn against each other
//! the others say nothing, and a fold that was predicted with both where their priors have them was off by that.
//! Columns of the training Gram that no product joins are in pieces; the fold keeps that of which it sees most, and
//! finds the others by itself.
//!
//! Not physics: connected components.

use std::ops::Range;

use nalgebra::DMatrix;

/// Share of the columns' lengths below which a product is rounding.
const JOINED: f64 = 1e-9;

/// Columns of `relative` that training data (`train`) does not join to those of which the fold (`own`) sees most.
pub(super) fn apart(
    train: &DMatrix<f64>,
    own: &DMatrix<f64>,
    relative: Range<usize>,
) -> Vec<usize> {
    let seen: Vec<usize> = relative
        .filter(|&k| own[(k, k)] > 0.0 || train[(k, k)] > 0.0)
        .collect();
    let mut piece: Vec<usize> = (0..seen.len()).collect();
    for (i, &a) in seen.iter().enumerate() {
        for (j, &b) in seen[..i].iter().enumerate() {
            let lengths = (train[(a, a)] * train[(b, b)]).sqrt();
            let product = train[(a, b)].abs().max(train[(b, a)].abs());
            if product > JOINED * lengths {
                let (one, other) = (root(&mut piece, i), root(&mut piece, j));
                piece[one] = other;
            }
        }
    }
    let mut sees = vec![0.0; seen.len()];
    let roots: Vec<usize> = (0..seen.len()).map(|i| root(&mut piece, i)).collect();
    for (&root, &k) in roots.iter().zip(&seen) {
        if train[(k, k)] > 0.0 {
            sees[root] += own[(k, k)];
        }
    }
    let most = (0..sees.len()).max_by(|&i, &j| sees[i].total_cmp(&sees[j]));
    let others = roots
        .iter()
        .zip(&seen)
        .filter(|(root, k)| Some(**root) != most && own[(**k, **k)] > 0.0);
    others.map(|(_, &k)| k).collect()
}

fn root(piece: &mut [usize], mut k: usize) -> usize {
    while piece[k] != k {
        piece[k] = piece[piece[k]];
        k = piece[k];
    }
    k
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns 1 and 2 are joined, and 3 and 4, of which the fold sees more; 0 is in no piece, 5 in the fold alone.
    #[test]
    fn a_fold_keeps_the_piece_of_which_it_sees_most() {
        let mut train = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![
            9.0, 4.0, 4.0, 4.0, 4.0, 0.0,
        ]));
        for (a, b) in [(1, 2), (3, 4), (0, 1), (0, 3)] {
            train[(a, b)] = 1.0;
            train[(b, a)] = 1.0;
        }
        train[(2, 3)] = 1e-12;
        let own = DMatrix::from_diagonal(&nalgebra::DVector::from_vec(vec![
            9.0, 1.0, 1.0, 2.0, 2.0, 7.0,
        ]));
        assert_eq!(apart(&train, &own, 1..6), [1, 2, 5]);
        train[(1, 3)] = 1.0;
        assert_eq!(apart(&train, &own, 1..6), [5]);
        assert!(apart(&train, &own, 0..0).is_empty());
    }
}
